/* Convolutions of many channels: sums of thousands of terms, made in pieces so
 * that their rounding errors do not pile up as one long chain's would.  oneDNN
 * cuts such sums by the size of the cache, and so differs between machines. */
#ifndef SPID_NN_IM2COL_H
#define SPID_NN_IM2COL_H

#include "lib/nn/plan.h"

struct conv;
struct conv_shape;

struct im2col {
    const struct conv *c;
    size_t top, left;        /* zeros before the picture's first pixel */
    size_t K, N;             /* k k in; out rounded up to a panel */
    float *w;                /* packed, piece by piece */
    float *rows;             /* (a band of pixels, K); NULL: a window is a
                              * pixel, and they are the input */
    float *sum;              /* (a band of pixels, out), where it is added to
                              * the output; else NULL */
};

/* NN_F32: every sum of 512 terms or more.  NN_FAST: of 2,048 where few pixels
 * are made of them: StyleUNet's innermost layers, whose errors would reach
 * every other layer by the style. */
bool im2col_wanted(const struct conv *c);
/* A conv_method's plan, update and forward. */
void im2col_plan(struct conv *c, const struct conv_shape *s);
void im2col_update(struct conv *c, const float *w);
void im2col_forward(float *out, const float *in, struct conv *c);

#endif
