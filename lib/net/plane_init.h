/* Phi_init: three 3x3 convolutions on [features, coverage], tanh, times
 * delta_max: how far each cell of the plane moves (Eq. for Delta U).
 * Tensors "<prefix>{0,2,4}.{weight,bias}"; the last layer starts at zero. */
#ifndef SPID_NET_PLANE_INIT_H
#define SPID_NET_PLANE_INIT_H

#include "lib/nn/tape.h"

#define PLANE_INIT_MAX 0.05f

struct plane_init {
    struct tape tape;
    size_t width;                 /* of the two hidden layers */
};

/* Declare the tensors: in channels of the input (features + 1), width of the
 * hidden layers. */
void plane_init_init(struct plane_init *p, struct params *ps,
                     const char *prefix, size_t in, size_t width);
/* Inputs of height x width cells. */
int plane_init_plan(struct plane_init *p, size_t height, size_t width,
                    struct nn_options opt, struct error *err);
/* Free what _init and _plan allocated; zeroed then. */
void plane_init_release(struct plane_init *p);

/* delta (h,w,2), x then y, in [-0.05, 0.05]; in (h,w,in). */
void plane_init_forward(float *delta, const float *in, struct plane_init *p);
/* din (h,w,in), or NULL, from ddelta (h,w,2). */
void plane_init_backward(float *din, const float *ddelta,
                         struct plane_init *p);

/* The same as a graph of n x n cells: "features" (1,n,n,in), coverage last, to
 * "delta" (1,n,n,2). */
void plane_init_graph(struct graph *g, size_t n, const struct plane_init *p);

#endif
