/* Golden files hold planes (NCHW); the networks take rows (NHWC). */
#ifndef SPID_TESTS_LAYOUT_H
#define SPID_TESTS_LAYOUT_H

#include <stdlib.h>

#include "tests/golden/golden.h"

/* (B,C,pixels) <- (B,pixels,C), fresh. */
static inline float *layout_planes(const float *x, size_t B, size_t pixels,
                                   size_t C)
{
    float *out = malloc(B * pixels * C * sizeof *out);
    for (size_t n = 0; n < B; n++)
        for (size_t i = 0; i < pixels; i++)
            for (size_t c = 0; c < C; c++)
                out[(n * C + c) * pixels + i] = x[(n * pixels + i) * C + c];
    return out;
}

/* (B,pixels,C) <- (B,C,pixels), fresh. */
static inline float *layout_rows(const float *x, size_t B, size_t pixels,
                                 size_t C)
{
    return layout_planes(x, B, C, pixels);
}

/* Compare x (B,pixels,C) with NAME, which is (B,C,pixels). */
static inline void layout_compare(struct golden *g, const char *name,
                                  const float *x, size_t B, size_t pixels,
                                  size_t C, bool l2)
{
    float *p = layout_planes(x, B, pixels, C);
    (l2 ? golden_compare_l2 : golden_compare)(g, name, p, B * pixels * C);
    free(p);
}

#endif
