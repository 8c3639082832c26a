/* Phi_S and Phi_M: three 3x3 convolutions (ReLU) and a 1x1 on a feature image
 * with gamma(n) appended to every pixel; one Gaussian per pixel.
 * Tensors "<prefix>gaussian_conv.{0,2,4,6}.{weight,bias}", inputs ordered
 * [features, gamma]. */
#ifndef SPID_NET_CONV_DECODER_H
#define SPID_NET_CONV_DECODER_H

#include "lib/net/gaussian_head.h"
#include "lib/nn/tape.h"

struct conv_decoder {
    struct gaussian_head head;
    struct tape tape;
    int gamma;                   /* the map of features with gamma behind */
};

/* Declare the tensors: features' channels, the layers' width (128 in the
 * paper); head says what comes out. */
void conv_decoder_init(struct conv_decoder *d, struct params *ps,
                       const char *prefix, size_t in, size_t width,
                       struct gaussian_head head);
/* For features of height x width. */
int conv_decoder_plan(struct conv_decoder *d, size_t batch, size_t height,
                      size_t width, struct nn_options opt, struct error *err);
/* Free what _init and _plan allocated; zeroed then. */
void conv_decoder_release(struct conv_decoder *d);

/* Where a caller may write the features itself, (B,h,w) rows of `in` floats and
 * *stride from one to the next; until the next network's forward. */
float *conv_decoder_rows(size_t *stride, const struct conv_decoder *d);

/* out (B,h*w,...) from features (B,h,w,in), or NULL: those in
 * conv_decoder_rows; dir (B,3) the viewing direction, rgb_logit (B,h*w,3) or
 * NULL. */
void conv_decoder_forward(struct gaussian_out *out, const float *features,
                          const float *dir, const float *rgb_logit,
                          struct conv_decoder *d);
/* dfeatures (B,h,w,in), drgb_logit (B,h*w,3), ddir (B,3): written, or NULL. */
void conv_decoder_backward(float *dfeatures, float *ddir, float *drgb_logit,
                           const struct gaussian_out *dout,
                           const float *dir, const float *rgb_logit,
                           struct conv_decoder *d);

/* The same as a graph of n x n cells: "features" (1,n,n,in), "direction" (1,3)
 * and "rgb_logit" (n*n,3) to the attributes (gaussian_head_graph). */
void conv_decoder_graph(struct graph *g, size_t n,
                        const struct conv_decoder *d);

#endif
