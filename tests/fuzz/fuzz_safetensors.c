/* libFuzzer target: safetensors files, and the record list in their
 * metadata. */
#include <stdlib.h>

#include "formats/recordfile.h"
#include "formats/safetensors.h"
#include "tests/fuzz/memory_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct error err;
    struct safetensors *st;
    size_t sum = 0;
    char path[40];
    int fd = memory_file(path, data, size);

    if (fd < 0)
        return 0;
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
    close(fd);
    return sum == SIZE_MAX;
}
