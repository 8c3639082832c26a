/* The two blocks that StyleUNet's encoder is made of, each with its own
 * buffers.  Behind lib/net/style_unet.h. */
#ifndef SPID_NET_STYLE_BLOCKS_H
#define SPID_NET_STYLE_BLOCKS_H

#include "lib/nn/conv.h"
#include "lib/nn/rescale.h"

/* h = lrelu(conv1 x); h = rs(h, f); h = lrelu(conv2 h); h + skip(rs(x, f)) */
struct style_res {
    struct conv conv1, conv2, skip;
    bool up;
    size_t h, w;                 /* of the input */
    struct rescale move_h, move_x;
    float *h1, *h1s, *h2, *xs, *sx, *out;
};

/* conv, lrelu, conv */
struct style_condition {
    struct conv a, b;
    float *h, *out;
};

/* A convolution with leaky ReLU and the gain that goes with it. */
void style_lrelu_conv(struct conv *c, struct params *ps,
                      const char *name, size_t in, size_t out,
                      size_t kernel);
/* A residual block that halves the map or doubles it. */
void style_res_init(struct style_res *r, struct params *ps,
                    const char *at, size_t in, size_t out, bool up);
/* Two convolutions that make a scale (bias 1) or a shift (bias 0). */
void style_condition_init(struct style_condition *c, struct params *ps,
                          const char *at, size_t in, size_t out,
                          float bias);
/* A residual block on B maps of side x side. */
void style_res_plan(struct style_res *r, struct nn_plan *p, size_t B,
                    size_t side);
/* A condition on B maps of side x side. */
void style_condition_plan(struct style_condition *c, struct nn_plan *p,
                          size_t B, size_t side);
/* Values of the block's output. */
size_t style_res_size(const struct style_res *r);
/* r->out from x. */
void style_res_forward(const float *x, struct style_res *r);
/* dx (written) from dout; a, b scratch; dout is overwritten. */
void style_res_backward(float *dx, float *dout, const float *x,
                        float *a, float *b, struct style_res *r);
/* c->out from the map f. */
void style_condition_forward(const float *f, struct style_condition *c);
/* df += ; dout is not kept. */
void style_condition_backward(float *df, float *dout, const float *f,
                              float *a, float *b,
                              struct style_condition *c);

#endif
