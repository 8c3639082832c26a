/* Heads of random numbers, for tests that need no shape. */
#ifndef SPID_TESTS_RANDOM_HEAD_H
#define SPID_TESTS_RANDOM_HEAD_H

#include <stdio.h>
#include <stdlib.h>

#include "lib/base/random.h"
#include "lib/head/head.h"

/* n of them, each within bound of 0; the caller frees. */
static inline float *random_numbers(struct random *r, size_t n, double bound)
{
    float *x = malloc((n + 1) * sizeof *x);

    for (size_t i = 0; i < n; i++)
        x[i] = (float)random_range(r, -bound, bound);
    return x;
}

/* h made from a, whose template, directions and lids came from random_numbers
 * (or are NULL) and are freed. */
static inline void random_head_init(struct head *h, struct head_arrays *a)
{
    const float *const drawn[] = {a->v_template, a->shapedirs, a->posedirs,
                                  a->l_eyelid, a->r_eyelid, a->lid_shapedirs};
    struct error err = {0};

    if (head_init(h, a, &err)) {
        printf("%s\n", err.text);
        exit(1);
    }
    for (size_t i = 0; i < sizeof drawn / sizeof *drawn; i++)
        free((void *)(uintptr_t)drawn[i]);
}

#endif
