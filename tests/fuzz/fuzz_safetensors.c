/* libFuzzer target: safetensors files, and the record list in their
 * metadata. */
#include <stdlib.h>

#include "formats/recordfile.h"
#include "formats/safetensors.h"
#include "tests/fuzz/memory_file.h"

static int safetensors_read(const char *path)
{
    struct error err;
    struct safetensors *st;
    size_t sum = 0;

    st = st_open(path, &err);
    for (size_t i = 0; st && i < st_count(st); i++) {
        const struct st_tensor *t = st_at(st, i);

        free(st_load_f32(st, t->name, t->ndim, t->dim, NULL, &err));
        free(st_load_i32(st, t->name, t->ndim, t->dim, NULL, &err));
        sum += st_find(st, t->name) != NULL;
    }
    if (st)
        recordfile_read_st(path, record_sum, &sum, &err);
    st_close(st);
    return sum == SIZE_MAX;
}

FUZZ_FILE(safetensors_read)
