/* Max pooling in windows of 3x3 pixels with stride 2, NHWC; the first ones may
 * begin before the border, and the last may be cut off at it ("ceil mode"): what
 * lies outside counts for nothing. */
#ifndef SPID_LAB_EVAL_MAX_POOL_H
#define SPID_LAB_EVAL_MAX_POOL_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/nn/plan.h"

struct max_pool {
    size_t batch, h, w, oh, ow;
    size_t before;                /* pixels that the first window is cut by */
    size_t channels;
    float *which;                 /* (B,oh,ow,C): place of the greatest value
                                   * in its window, 0..8; NULL in NN_INFER */
};

/* For maps (batch,h,w,channels). */
void max_pool_plan(struct max_pool *m, struct nn_plan *p, size_t batch,
                   size_t h, size_t w, size_t channels, size_t before,
                   bool cut);
/* out (B,oh,ow,C) from in (B,h,w,C); of equal values the first counts. */
void max_pool_forward(float *out, const float *in, struct max_pool *m);
/* din (B,h,w,C) is written, from dout (B,oh,ow,C); before is 0. */
void max_pool_backward(float *din, const float *dout,
                       const struct max_pool *m);

#endif
