/* Runs of covered pixels: found, joined, put back and counted row by row. */
#include "lib/base/covered.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/list.h"

/* One more run; NULL without memory. */
static struct iovec *covered_add(struct covered *c)
{
    return list_add(&c->run, &c->runs, &c->room, sizeof *c->run, NULL);
}

int covered_find(struct covered *c, const void *image, const float *alpha,
                 size_t n, size_t bytes)
{
    /* an iovec's pointer is never const; these are only read */
    unsigned char *from = (unsigned char *)(uintptr_t)image;

    c->runs = c->pixels = 0;
    if (!covered_add(c))        /* no runs are not no list */
        return -1;
    c->runs = 0;
    for (size_t at = 0, end; at < n; at = end) {
        end = covered_run(alpha, at, n);
        if (alpha[at] == 0)
            continue;
        struct iovec *run = covered_add(c);
        if (!run)
            return -1;
        *run = (struct iovec){from + at * bytes, (end - at) * bytes};
        c->pixels += end - at;
    }
    return 0;
}

void covered_release(struct covered *c)
{
    free(c->run);
    memset(c, 0, sizeof *c);
}

int covered_unpack(void *image, const void *packed, size_t count,
                   const float *alpha, size_t n, size_t bytes)
{
    unsigned char *to = image;
    const unsigned char *from = packed;

    for (size_t at = 0, end; at < n; at = end) {
        end = covered_run(alpha, at, n);
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

size_t covered_rows(size_t *start, const float *alpha, size_t height,
                    size_t width)
{
    size_t sum = 0;

    for (size_t y = 0; y < height; y++, alpha += width) {
        unsigned row = 0;

        start[y] = sum;
#pragma omp simd reduction(+:row)
        for (size_t x = 0; x < width; x++)
            row += alpha[x] != 0;
        sum += row;
    }
    return sum;
}
