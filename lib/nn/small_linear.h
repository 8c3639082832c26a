/* Linear layers of a few rows (the style and what it scales): summed in double
 * precision, for an error there shifts every pixel alike, and reading the
 * weights is what costs. */
#ifndef SPID_NN_SMALL_LINEAR_H
#define SPID_NN_SMALL_LINEAR_H

#include "lib/nn/plan.h"

struct conv;
struct conv_shape;

struct small_linear {
    float *w;                /* (out,in) */
};

/* 1x1 of at most 16 pixels in all. */
bool small_linear_wanted(const struct conv *c);
/* A conv_method's plan, update and forward. */
void small_linear_plan(struct conv *c, const struct conv_shape *s);
void small_linear_update(struct conv *c, const float *w);
void small_linear_forward(float *out, const float *in, struct conv *c);

#endif
