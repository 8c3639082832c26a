/* libFuzzer target: the inside of numpy's archives.  The input is the bytes of
 * an npy file; it is stored in a sound archive here, since a fuzzer does not
 * find its checksum. */
#include <string.h>

#include "tests/fuzz/read_tensors.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static uint32_t crc32_of(const uint8_t *p, size_t n)
{
    uint32_t c = ~0u;

    while (n--) {
        c ^= *p++;
        for (int k = 0; k < 8; k++)
            c = c >> 1 ^ (0xedb88320u & -(c & 1));
    }
    return ~c;
}

static size_t npz_put(uint8_t *out, size_t at, const void *p, size_t n)
{
    memcpy(out + at, p, n);
    return at + n;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char name[5] = {'a', '.', 'n', 'p', 'y'};
    static uint8_t zip[(64 << 10) + 200];
    uint32_t n = (uint32_t)size, start, length;
    size_t at;

    if (size > sizeof zip - 200)
        return 0;
    uint8_t head[26] = {20, 0};

    head[8] = 33;
    uint32_t sum = crc32_of(data, size);

    memcpy(head + 10, &sum, 4);
    memcpy(head + 14, &n, 4);
    memcpy(head + 18, &n, 4);
    head[22] = sizeof name;
    at = npz_put(zip, 0, "PK\3\4", 4);
    at = npz_put(zip, at, head, 26);
    at = npz_put(zip, at, name, sizeof name);
    at = npz_put(zip, at, data, size);
    start = (uint32_t)at;
    at = npz_put(zip, at, "PK\1\2\24\0", 6);
    at = npz_put(zip, at, head, 26);
    memset(zip + at, 0, 14);
    at = npz_put(zip, at + 14, name, sizeof name);
    length = (uint32_t)at - start;
    at = npz_put(zip, at, "PK\5\6\0\0\0\0\1\0\1\0", 12);
    at = npz_put(zip, at, &length, 4);
    at = npz_put(zip, at, &start, 4);
    at = npz_put(zip, at, "\0\0", 2);
    return read_tensors(zip, at);
}
