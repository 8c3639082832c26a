/* Max pooling in windows of 3x3 pixels with stride 2, no padding, and the last
 * window cut off at the border ("ceil mode"), NHWC. */
#ifndef SPID_NN_POOL_H
#define SPID_NN_POOL_H

#include "lib/nn/plan.h"

struct max_pool {
    size_t batch, h, w, oh, ow;
    size_t channels;              /* a multiple of 16 */
    float *which;                 /* (B,oh,ow,C): place of the greatest value
                                   * in its window, 0..8; NULL in NN_INFER */
};

/* Pixels that come of n, which is 2 or more. */
size_t max_pool_size(size_t n);
/* Maps (batch,h,w,channels) of 2x2 pixels or more. */
void max_pool_plan(struct max_pool *m, struct nn_plan *p, size_t batch,
                   size_t h, size_t w, size_t channels);
/* out (B,oh,ow,C) from in (B,h,w,C); of equal values the first counts. */
void max_pool_forward(float *out, const float *in, struct max_pool *m);
/* din (B,h,w,C) is written, from dout (B,oh,ow,C). */
void max_pool_backward(float *din, const float *dout,
                       const struct max_pool *m);

#endif
