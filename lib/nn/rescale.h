/* Resizing feature images, NHWC, as a sparse matrix per axis: every mode is
 * the same two passes with other weights, and so is every backward. */
#ifndef SPID_NN_RESCALE_H
#define SPID_NN_RESCALE_H

#include <stdint.h>

#include "lib/nn/plan.h"

enum rescale_mode {
    RESCALE_BILINEAR,    /* align_corners=false: src = (dst+0.5) n/m - 0.5 */
    RESCALE_ALIGNED,     /* align_corners=true: src = dst (n-1)/(m-1) */
    RESCALE_ANTIALIAS,   /* triangle as wide as an output pixel */
    RESCALE_BICUBIC,     /* A = -0.75, borders clamped, no antialias */
    RESCALE_BICUBIC_ANTIALIAS,  /* A = -0.5, as wide as RESCALE_ANTIALIAS's */
    RESCALE_AREA,        /* means of what an output pixel covers */
    RESCALE_TOUCHED      /* means of the whole pixels of which it covers some:
                          * torch's adaptive pooling; not by factors */
};

/* out[o] = sum_k weight[o][k] in[first[o]+k], and the same transposed:
 * din[i] = sum over j in [start[i], start[i+1]) of tweight[j] dout[from[j]] */
struct rescale_axis {
    size_t in, out, taps;
    int32_t *first;      /* (out) */
    float *weight;       /* (out,taps) */
    int32_t *start;      /* (in+1) */
    int32_t *from;       /* (entries) */
    float *tweight;      /* (entries) */
};

struct rescale {
    size_t batch, C;
    struct rescale_axis y, x;
    struct nn_plan *plan;
    size_t line;         /* floats of one thread's row */
};

/* h x w -> oh x ow. */
void rescale_plan(struct rescale *r, struct nn_plan *p, enum rescale_mode mode,
                  size_t batch, size_t h, size_t w, size_t oh, size_t ow,
                  size_t C);
/* With factors in place of oh/h and ow/w: src = (dst+0.5)/factor - 0.5. */
void rescale_plan_factor(struct rescale *r, struct nn_plan *p,
                         enum rescale_mode mode, size_t batch, size_t h,
                         size_t w, size_t oh, size_t ow, double factor_y,
                         double factor_x, size_t C);
/* out (B,oh,ow,C) from in (B,h,w,C). */
void rescale_forward(float *out, const float *in, struct rescale *r);
/* din is written. */
void rescale_backward(float *din, const float *dout, struct rescale *r);

#endif
