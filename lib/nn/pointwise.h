/* 1x1 convolutions of networks that learn, in bfloat16: forward, the input's
 * gradient and the weights', all three with sums in float.  Activations stay
 * float in memory and are rounded on their way into the first-level cache, so
 * that only the products lose digits (2^-9 of each factor). */
#ifndef SPID_NN_POINTWISE_H
#define SPID_NN_POINTWISE_H

#include <stdint.h>

#include "lib/nn/plan.h"

#define POINTWISE_PAIRS 64   /* pairs of rows summed before they are stored */

struct conv;
struct conv_shape;

struct pointwise {
    struct nn_plan *plan;
    size_t rows, in, out;        /* rows: pixels of all images */
    uint32_t *forward, *back;    /* packed weights, and transposed */
    size_t band;                 /* rows that one thread does at a time */
    size_t half_size;            /* bytes of a thread's rounded rows */
    size_t pairs_size;           /* bytes of a part's rounded pairs of rows */
    float *dw;                   /* (NN_PARTS,out,in up to 16) */
};

/* NN_BF16 plans with a backward, where the processor has the products: plain
 * 1x1 layers, even numbers of channels, no bias and no activation. */
bool pointwise_wanted(const struct conv *c);
/* A conv_method's plan, update and forward. */
void pointwise_plan(struct conv *c, const struct conv_shape *s);
void pointwise_update(struct conv *c, const float *w);
void pointwise_forward(float *out, const float *in, struct conv *c);
/* din (rows,in) from dout (rows,out). */
void pointwise_backward_data(float *din, const float *dout,
                             struct pointwise *t);
/* g (out,in) += the weights' gradient. */
void pointwise_backward_weights(float *g, const float *dout, const float *in,
                                struct pointwise *t);

#endif
