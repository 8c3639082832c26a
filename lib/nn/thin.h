/* Linear layers of a few rows (the style and what it scales): summed in double
 * precision, for an error there shifts every pixel alike, and reading the
 * weights is what costs. */
#ifndef SPID_NN_THIN_H
#define SPID_NN_THIN_H

#include "lib/nn/plan.h"

struct conv;

struct thin {
    const struct conv *c;
    float *w, *bias;         /* (out,in), (out) */
};

/* 1x1 of at most 16 pixels in all, in NN_F32 or NN_FAST. */
bool thin_wanted(const struct conv *c);
void thin_plan(struct thin *t, const struct conv *c, struct nn_plan *p);
void thin_update(struct thin *t, const float *w, const float *bias);
void thin_forward(float *out, const float *in, const struct thin *t);

#endif
