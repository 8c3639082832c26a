/* Convolutions of many channels: sums of thousands of terms, made in pieces so
 * that their rounding errors do not pile up as one long chain's would.  oneDNN
 * cuts such sums by the size of the cache, and so differs between machines.  And
 * layers of one tap, which are products of matrices as they are: oneDNN's are as
 * fast, but making the code of each takes as long as running it ten times. */
#ifndef SPID_NN_IM2COL_H
#define SPID_NN_IM2COL_H

#include "lib/nn/plan.h"

struct conv;
struct conv_shape;

struct im2col {
    const struct conv *c;
    size_t top, left;        /* zeros before the picture's first pixel */
    size_t K, N;             /* k k in; out rounded up to a panel */
    size_t piece;            /* terms of a chain, at most */
    size_t rows;             /* pixels of a piece of work */
    size_t unfold, own;      /* floats of a thread's scratch: their windows (0:
                              * these are the input's pixels), and in all */
    float *w;                /* packed, piece by piece */
};

/* Every layer of one tap that does not learn.  NN_F32: every sum of 512 terms or
 * more.  NN_FAST: of 2,048 where few pixels
 * are made of them: StyleUNet's innermost layers, whose errors would reach
 * every other layer by the style. */
bool im2col_wanted(const struct conv *c);
/* A conv_method's plan, update and forward. */
void im2col_plan(struct conv *c, const struct conv_shape *s);
void im2col_update(struct conv *c, const float *w);
void im2col_forward(float *out, const float *in, struct conv *c);

#endif
