/* Convolutions and linear layers through oneDNN (and Winograd of our own
 * where the table says so); activations are NHWC floats.  In an NN_BF16 plan
 * the products are of bfloat16 values, summed in float. */
#ifndef SPID_NN_CONV_H
#define SPID_NN_CONV_H

#include "lib/nn/act.h"
#include "lib/nn/norm.h"
#include "lib/nn/params.h"
#include "lib/nn/plan.h"

enum conv_pad {
    CONV_HALF,     /* kernel/2 on every side */
    CONV_SAME,     /* TensorFlow's: the odd one goes right and down */
    CONV_NONE      /* no padding: patches */
};

struct conv_impl;

struct conv {
    /* as declared */
    struct params *ps;
    size_t weight, bias;          /* tensors in ps; bias may be NN_NONE */
    size_t in, out, kernel, stride;
    enum conv_pad pad;
    /* set between _init and _plan */
    enum nn_act act;              /* applied to the output; plans with a
                                   * backward: NONE, RELU, LRELU */
    bool add;                     /* forward adds to what out holds (before
                                   * act); its backward passes dout on */
    bool no_din;                  /* nobody asks for din */
    const struct batch_norm *norm;  /* folded in; or NULL */
    size_t gamma;                 /* tensor (out) in ps that scales the whole
                                   * output, folded; or NN_NONE.  NN_INFER */
    const float *from;            /* weights in place of the tensor's, for
                                   * conv_update (conditional_conv.h), or
                                   * NULL */
    float *from_g;                /* where their gradients are added then, in
                                   * place of the tensor's; or NULL */
    size_t shuffle;               /* factor of a transposed convolution, or 0:
                                   * `out` then counts its pixels too */
    size_t in_data;               /* channels in memory if more than `in`
                                   * (the rest is zero), else 0 */
    bool half_in, half_out;       /* input or output, and its gradient, lie in
                                   * memory as bfloat16, which is what is
                                   * multiplied: only where conv_halves says
                                   * so; no act but RELU, and no add.  Outputs
                                   * of 1x1 layers then fill whole vectors */
    /* as planned */
    size_t batch, h, w, oh, ow;
    struct nn_plan *plan;
    struct conv_impl *impl;
};

/* Declare "<name>.weight" (out,in,k,k) and, with bias, "<name>.bias". */
void conv_init(struct conv *c, struct params *ps, const char *name, size_t in,
               size_t out, size_t kernel, size_t stride, bool bias);
/* The same as a linear layer with a bias: the weight is (out,in), kernel 1; plan
 * it with h = rows, w = 1. */
void linear_init(struct conv *c, struct params *ps, const char *name, size_t in,
                 size_t out);
/* A transposed convolution whose kernel is its stride f: the weight is
 * (in,out,f,f); the forward gives (B,h,w,f*f*out), which
 * depth_to_space (lib/nn/image.h) lays out as (B,h f,w f,out). */
void deconv_init(struct conv *c, struct params *ps, const char *name,
                 size_t in, size_t out, size_t f);
/* Whether layers of this plan may have half_in and half_out. */
bool conv_halves(const struct nn_plan *p);
/* Inputs (batch,h,w,in_data); chooses who computes the forward. */
void conv_plan(struct conv *c, struct nn_plan *p, size_t batch, size_t h,
               size_t w);
/* A linear layer on `rows` rows. */
void linear_plan(struct conv *c, struct nn_plan *p, size_t rows);
/* This layer's weights changed; nn_plans_update does it for all. */
void conv_update(struct conv *c);

/* out (B,oh,ow,out) = act(conv(in (B,h,w,in_data))); floats, or what half_in
 * and half_out say. */
void conv_forward(void *out, const void *in, struct conv *c);
/* din (B,h,w,in) is written unless NULL; weight and bias gradients are added
 * to ps->g, unless their tensors are frozen (which weights must be before the
 * planning, or never); dout is overwritten by the gradient before the
 * activation. */
void conv_backward(void *din, void *dout, const void *out, const void *in,
                   struct conv *c);
/* The same for din alone: no gradient of weight or bias. */
void conv_backward_input(void *din, void *dout, const void *out,
                         struct conv *c);

struct winograd;
/* A planned layer's Winograd, where that is how it is computed; or NULL. */
struct winograd *conv_winograd(struct conv *c);

/* buf <- formatted name. */
const char *nn_name(char buf[120], const char *format, ...)
    __attribute__((format(printf, 2, 3)));

#endif
