/* Linear layers of one row at a time, which need no plan: heads of pooled
 * features. */
#ifndef SPID_NN_DENSE_H
#define SPID_NN_DENSE_H

#include "lib/nn/params.h"

struct dense {
    struct params *ps;          /* NULL: none declared */
    size_t weight, bias;        /* tensors in ps: (out,in), (out) */
    size_t in, out;
};

/* Declare "<name>.weight", `gain` times the usual size, and "<name>.bias". */
void dense_init(struct dense *d, struct params *ps, const char *name,
                size_t in, size_t out, float gain);
/* y (out) = W x + b, x (in). */
void dense_forward(float *y, const float *x, const struct dense *d);
/* Gradients of x (in) and of the tensors are added to, from dy (out). */
void dense_backward(float *dx, const float *dy, const float *x,
                    const struct dense *d);

#endif
