/* A convolution whose weights depend on a few numbers given with the input:
 * W + sum_j by[j] V_j.  The numbers are the same for the whole batch. */
#ifndef SPID_NN_VARY_H
#define SPID_NN_VARY_H

#include "lib/nn/conv.h"

struct vary {
    struct conv *conv;
    size_t tensor;                /* V (n,out,in,k,k) in conv->ps */
    size_t n;
    float *sum, *was;             /* weights; their gradients so far */
};

/* Let c, a plain convolution or linear layer, depend on n numbers: declares
 * "<name>.vary", zero. */
void vary_init(struct vary *v, struct conv *c, const char *name, size_t n);
/* Beside conv_plan. */
void vary_plan(struct vary *v, struct nn_plan *p);
/* The weights for by (n), which the next conv_update takes over. */
void vary_set(struct vary *v, const float *by);
/* conv_backward; the gradients of V and by (as set) are added as well. */
void vary_backward(float *din, float *dby, float *dout, const float *out,
                   const float *in, const float *by, struct vary *v);

#endif
