/* libFuzzer target: records as JSON. */
#include "formats/recordjson.h"
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
    size_t sum = 0;
    char path[40];
    int fd = memory_file(path, data, size);

    if (fd < 0)
        return 0;
    recordjson_read(path, 25.0, 1 << 20, take, &sum, &err);
    close(fd);
    return sum == SIZE_MAX;
}
