/* A convolution whose weights depend on a few numbers given with the input:
 * W + sum_j by[j] V_j.  The numbers are the same for the whole batch. */
#ifndef SPID_NN_CONDITIONAL_CONV_H
#define SPID_NN_CONDITIONAL_CONV_H

#include "lib/nn/conv.h"

struct conditional_conv {
    struct conv *conv;
    size_t tensor;                /* V (n,out,in,k,k) in conv->ps */
    size_t n;
    float *sum, *was;             /* weights; their gradients so far */
};

/* Let c, a plain convolution or linear layer, depend on n numbers: declares
 * "<name>.vary", zero. */
void conditional_conv_init(struct conditional_conv *v, struct conv *c,
                           const char *name, size_t n);
/* Beside conv_plan. */
void conditional_conv_plan(struct conditional_conv *v, struct nn_plan *p);
/* The weights for by (n), which the next conv_update takes over. */
void conditional_conv_set(struct conditional_conv *v, const float *by);
/* conv_backward; the gradients of V and by (as set) are added as well. */
void conditional_conv_backward(float *din, float *dby, float *dout,
                               const float *out, const float *in,
                               const float *by, struct conditional_conv *v);

#endif
