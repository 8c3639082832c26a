/* Convolutions of 8-bit values, summed exactly in 32 bits, by oneDNN.  Weights
 * are signed with a scale for every output channel; activations are unsigned,
 * their scale and zero point taken from the picture at hand, so that nothing
 * has to be calibrated and the same picture gives the same bits. */
#ifndef SPID_NN_INT8_H
#define SPID_NN_INT8_H

#include <stdint.h>

#include "lib/nn/plan.h"

struct conv;

/* One layer, as planned.  The input is copied with its padding, of value
 * `zero`, into batch x h x w x in bytes of the plan's scratch. */
struct int8 {
    size_t h, w;             /* with padding */
    size_t top, left;        /* rows and columns of it before the picture */
    size_t at;               /* bytes into the scratch */
    int8_t *weight;          /* (out,in,k,k) */
    float *step;             /* (out) of the weights */
    float *sum;              /* (out) of the weights: what `zero` adds */
    float *scale, *bias;     /* (out) of this picture: the primitive makes
                              * act(scale (sum of products + bias)) */
};

/* Buffers; `at` is set by the caller, who asks for the scratch too. */
void int8_plan(struct int8 *q, const struct conv *c, struct nn_plan *p);
/* Bytes of the padded input. */
size_t int8_input_size(const struct int8 *q, const struct conv *c);
/* From weights w (out,in,k,k). */
void int8_update(struct int8 *q, const struct conv *c, const float *w);
/* The input as bytes, returned; scale and bias for it, from the layer's bias
 * (out). */
const uint8_t *int8_input(struct int8 *q, const struct conv *c,
                          const float *in, const float *bias);

#endif
