/* Winograd F(4x4,3x3) convolutions, float, NHWC: a quarter of the
 * multiplications at an error of a few 1e-6 of the largest value. */
#ifndef SPID_NN_WINOGRAD_H
#define SPID_NN_WINOGRAD_H

#include "lib/nn/plan.h"

struct conv;

struct winograd {
    const struct conv *c;
    float *u;                /* (36,in,out) transformed weights, packed */
    float *bias;
    float *work;             /* per thread */
    size_t work_size;
};

/* Whether the table of `make tune` prefers it for this layer (3x3, stride 1,
 * float, enough channels); depends on the layer's sizes only. */
bool winograd_wanted(const struct conv *c);
void winograd_plan(struct winograd *g, const struct conv *c,
                   struct nn_plan *p);
/* w (out,in_data,3,3), bias (out) */
void winograd_update(struct winograd *g, const float *w, const float *bias);
void winograd_forward(float *out, const float *in, struct winograd *g);

#endif
