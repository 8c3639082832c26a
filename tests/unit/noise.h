/* Random numbers for tests of networks. */
#ifndef SPID_TESTS_NOISE_H
#define SPID_TESTS_NOISE_H

#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "lib/base/random.h"

/* n numbers between from and to, the same for a name and a seed; the caller
 * frees. */
static inline float *noise_make(const char *name, size_t n, uint64_t seed,
                                double from, double to)
{
    struct random r;
    float *x = malloc(n * sizeof *x);

    random_init(&r, seed, name);
    for (size_t i = 0; i < n; i++)
        x[i] = (float)random_range(&r, from, to);
    return x;
}

/* x (n): a smooth picture W pixels wide, of three channels, with such noise. */
static inline void noise_waves(float *x, const char *name, size_t n,
                               uint64_t seed, size_t W, double phase)
{
    struct random r;

    random_init(&r, seed, name);
    for (size_t i = 0; i < n; i++)
        x[i] = (float)(0.5 + 0.3 * sin((double)(i / 3 % W) / 7 + phase) *
                                 cos((double)(i / 3 / W) / 9) +
                       random_range(&r, -0.1, 0.1));
}

#endif
