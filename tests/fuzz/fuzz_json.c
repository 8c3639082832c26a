/* libFuzzer target: records as JSON. */
#include "formats/recordjson.h"
#include "tests/fuzz/memory_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct error err;
    size_t sum = 0;
    char path[40];
    int fd = memory_file(path, data, size);

    if (fd < 0)
        return 0;
    recordjson_read(path, 25.0, 1 << 20, record_sum, &sum, &err);
    close(fd);
    return sum == SIZE_MAX;
}
