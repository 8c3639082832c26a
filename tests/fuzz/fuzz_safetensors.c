/* libFuzzer target: safetensors files, and the record list in their
 * metadata. */
#include <stdlib.h>

#include "formats/recordfile.h"
#include "formats/safetensors.h"
#include "tests/fuzz/memory_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static int take(const struct record *rec, void *context, struct error *err)
{
    size_t *sum = context;

    for (int i = 0; i < rec->count; i++)
        for (size_t k = 0; k < array_bytes(&rec->array[i]); k++)
            *sum += ((const uint8_t *)rec->array[i].data)[k];
    (void)err;
    return 0;
}

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
        recordfile_read_st(path, take, &sum, &err);
    st_close(st);
    close(fd);
    return sum == SIZE_MAX;
}
