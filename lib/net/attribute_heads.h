/* The four small heads of Phi_D as two layers, for learning in bfloat16: their
 * hidden layers stand side by side, their last ones are blocks of one matrix,
 * and gamma(n), the same for all points, is part of the hidden layers' bias.
 * The tensors stay those of the four. */
#ifndef SPID_NET_ATTRIBUTE_HEADS_H
#define SPID_NET_ATTRIBUTE_HEADS_H

#include "lib/nn/conv.h"

#define ATTRIBUTE_HEADS 4        /* colour, opacity, scale, rotation */

struct attribute_heads {
    const struct conv *inner, *outer;   /* (4) as declared */
    struct nn_plan *plan;
    struct conv hidden, last;
    size_t rows, width;          /* points, their numbers */
    float *w[2], *b[2];          /* of hidden and last */
    float *dw[2], *db[2];
    uint16_t *h, *dh;            /* (rows, all hidden numbers), bfloat16 */
    const float *gamma;          /* of the last forward */
};

/* Whether a plan can have it: bfloat16 that is learned in, and all of the
 * heads' tensors learn. */
bool attribute_heads_wanted(const struct conv inner[ATTRIBUTE_HEADS],
                            const struct conv outer[ATTRIBUTE_HEADS],
                            const struct nn_plan *p);
/* For `rows` points of `width` numbers; inner and outer stay where they are. */
void attribute_heads_plan(struct attribute_heads *a,
                          const struct conv inner[ATTRIBUTE_HEADS],
                          const struct conv outer[ATTRIBUTE_HEADS],
                          struct nn_plan *p, size_t rows, size_t width);

/* raw (rows, all attributes), one head's numbers after the other's, from y
 * (rows,width) in bfloat16 and gamma (27), which must last till the
 * backward. */
void attribute_heads_forward(float *raw, const uint16_t *y, const float *gamma,
                             struct attribute_heads *a);
/* dy (rows,width) in bfloat16 is written; dgamma (27) and the tensors'
 * gradients are added to; draw is used up. */
void attribute_heads_backward(uint16_t *dy, float *dgamma, float *draw,
                              const float *raw, const uint16_t *y,
                              struct attribute_heads *a);

#endif
