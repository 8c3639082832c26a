/* StyleGAN2's modulated layers without ever rebuilding a weight: the input is
 * scaled by the style, the output by the demodulation. */
#ifndef SPID_NN_STYLE_H
#define SPID_NN_STYLE_H

#include "lib/nn/conv.h"
#include "lib/nn/rescale.h"

struct style_conv {
    struct params *ps;
    struct conv conv, modulation;
    size_t gain, bias, noise;     /* tensors: (1), (1,C,1,1), (1,1,h,w) */
    size_t in, out;
    bool up;                      /* the input is enlarged twofold first */
    /* as planned */
    struct nn_plan *plan;
    size_t batch, h, w;           /* of the output */
    struct rescale grow;
    float *squares;               /* (out,in): sums of w^2 over the kernel */
    float *st, *d;                /* (B,in) style, (B,out) demod * sqrt 2 */
    float *xs, *xu, *u, *y;       /* x st; enlarged; convolved; finished */
    float *part;                  /* (NN_SUMS,3,max(in,out)) */
    float *dd, *dst, *dlatent;    /* (out), (B,in), (B,latent) */
};

/* Tensors "<name>.modulated_conv.weight" (1,out,in,k,k), "<name>.weight",
 * "<name>.bias", "<name>.modulated_conv.modulation.*"; noise is the buffer
 * `noise_name`, size x size. */
void style_conv_init(struct style_conv *s, struct params *ps,
                     const char *name, const char *noise_name, size_t size,
                     size_t in, size_t out, size_t latent, bool up);
/* h and w are the output's. */
void style_conv_plan(struct style_conv *s, struct nn_plan *p, size_t batch,
                     size_t h, size_t w);
/* s->y (B,h,w,out) from x (B,h,w,in), or half that size when `up`. */
void style_conv_forward(const float *x, const float *latent,
                        struct style_conv *s);
/* dx written; dlatent (B,latent) added to.  g0, g1: scratch, each as large as
 * the larger of xu and y, apart from dx and dy. */
void style_conv_backward(float *dx, float *dlatent, const float *dy,
                         const float *x, const float *latent, float *g0,
                         float *g1, struct style_conv *s);

struct to_rgb {
    struct conv conv, modulation;  /* weights (1,3,in,1,1), bias (1,3,1,1) */
    size_t in;
    size_t batch, h, w;
    bool first;                   /* nothing to enlarge and add to */
    struct rescale grow;
    float *st, *xs;               /* (B,in); x scaled (B,h,w,in) */
    float *rgb;                   /* (B,h,w,3) */
    float *part, *dst, *dlatent;
};

/* Declare "<name>.conv.weight", ".conv.modulation.*" and ".bias". */
void to_rgb_init(struct to_rgb *t, struct params *ps, const char *name,
                 size_t in, size_t latent, bool first);
/* h and w are the picture's at this level. */
void to_rgb_plan(struct to_rgb *t, struct nn_plan *p, size_t batch, size_t h,
                 size_t w);
/* t->rgb = W (x st) + b + grow(previous); previous (B,h/2,w/2,3) or NULL. */
void to_rgb_forward(const float *x, const float *latent,
                    const float *previous, struct to_rgb *t);
/* dx and dlatent are added to; dprevious is written (NULL for the first); g
 * scratch of x's size. */
void to_rgb_backward(float *dx, float *dlatent, float *dprevious, float *drgb,
                     const float *x, const float *latent, float *g,
                     struct to_rgb *t);

#endif
