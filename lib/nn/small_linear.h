/* Linear layers of a few rows (the style and what it scales): summed in double
 * precision, for an error there shifts every pixel alike, and reading the
 * weights is what costs. */
#ifndef SPID_NN_SMALL_LINEAR_H
#define SPID_NN_SMALL_LINEAR_H

#include "lib/nn/plan.h"

struct conv;

struct small_linear {
    const struct conv *c;
    float *w, *bias;         /* (out,in), (out) */
};

/* 1x1 of at most 16 pixels in all. */
bool small_linear_wanted(const struct conv *c);
/* Buffers for the layer c, whose sizes are known. */
void small_linear_plan(struct small_linear *t, const struct conv *c,
                       struct nn_plan *p);
/* From weights w (out,in_data) and bias (out). */
void small_linear_update(struct small_linear *t, const float *w,
                         const float *bias);
/* out (rows,out) = act(in (rows,in_data) w^T + bias) (+ out: add). */
void small_linear_forward(float *out, const float *in,
                          const struct small_linear *t);

#endif
