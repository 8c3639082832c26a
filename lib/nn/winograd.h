/* Winograd F(4x4,3x3) convolutions, float, NHWC: a quarter of the
 * multiplications at an error of a few 1e-6 of the largest value. */
#ifndef SPID_NN_WINOGRAD_H
#define SPID_NN_WINOGRAD_H

#include <stdint.h>

#include "lib/nn/act.h"
#include "lib/nn/plan.h"

struct conv;

struct winograd {
    size_t batch, h, w, in, out;
    size_t tiles;            /* computed together by one thread */
    size_t piece;            /* terms of one chain of a sum */
    enum nn_act act;
    bool add;
    float *u;                /* 36 packed (in,out) matrices */
    size_t u_size;           /* floats of one */
    size_t v_size, m_size;   /* floats from one matrix of a thread's to the
                              * next: an odd number of lines, so that they
                              * do not share the cache's sets */
    float *bias;             /* (out) */
    struct nn_plan *plan;
    size_t work;             /* floats of one thread: 36 (v_size + m_size) */
    const uint32_t *list;    /* numbers of the tiles of 4x4 outputs that are
                              * wanted (listed), row by row; NULL: all */
    size_t listed;
};

#define WINOGRAD_TILE 4      /* outputs across a tile */
#define WINOGRAD_PANEL 32    /* columns that gemm takes at once */

/* Buffers for the layer c, whose sizes are known. */
void winograd_plan(struct winograd *g, const struct conv *c,
                   struct nn_plan *p);
/* w (out,in,3,3), bias (out) */
void winograd_update(struct winograd *g, const float *w, const float *bias);
/* out (B,h,w,out) from in (B,h,w,in); of listed tiles, whose inputs are the
 * 6x6 about each, what other tiles hold is left as it is. */
void winograd_forward(float *out, const float *in, struct winograd *g);

#endif
