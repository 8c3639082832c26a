/* libFuzzer target: records as JSON. */
#include "formats/recordjson.h"
#include "tests/fuzz/memory_file.h"

static int json_read(const char *path)
{
    struct error err;
    size_t sum = 0;

    recordjson_read(path, 25.0, 1 << 20, record_sum, &sum, &err);
    return sum == SIZE_MAX;
}

FUZZ_FILE(json_read)
