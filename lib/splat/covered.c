#include "lib/splat/covered.h"

#include <stdbool.h>
#include <string.h>

/* Where the run of pixels that begins at `at`, all covered or all not, ends. */
static size_t run_end(const float *alpha, size_t at, size_t n)
{
    bool covered = alpha[at] != 0;

    while (at < n && (alpha[at] != 0) == covered)
        at++;
    return at;
}

size_t covered_pack(void *out, const void *image, const float *alpha,
                    size_t n, size_t bytes)
{
    unsigned char *to = out;
    const unsigned char *from = image;
    size_t count = 0;

    for (size_t at = 0, end; at < n; at = end) {
        end = run_end(alpha, at, n);
        if (alpha[at] == 0)
            continue;
        memcpy(to + count * bytes, from + at * bytes, (end - at) * bytes);
        count += end - at;
    }
    return count;
}

int covered_unpack(void *image, const void *packed, size_t count,
                   const float *alpha, size_t n, size_t bytes)
{
    unsigned char *to = image;
    const unsigned char *from = packed;

    for (size_t at = 0, end; at < n; at = end) {
        end = run_end(alpha, at, n);
        if (alpha[at] == 0) {
            memset(to + at * bytes, 0, (end - at) * bytes);
            continue;
        }
        if (end - at > count)
            return -1;
        memcpy(to + at * bytes, from, (end - at) * bytes);
        from += (end - at) * bytes;
        count -= end - at;
    }
    return count ? -1 : 0;
}
