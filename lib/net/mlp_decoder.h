/* Phi_D: the dynamic branch's decoder.  Four linear layers (ReLU between),
 * gamma(n) appended, then for colour, opacity, scale and rotation a hidden
 * layer of its own, or for colour alone.  Tensors "<prefix>feature_layers.{0,2,4,6}.*",
 * "<prefix>{color,opacity,scale,rotation}_layers.{0,2}.*". */
#ifndef SPID_NET_MLP_DECODER_H
#define SPID_NET_MLP_DECODER_H

#include "lib/net/gaussian_head.h"
#include "lib/nn/tape.h"

struct mlp_decoder {
    struct gaussian_head head;    /* position is GAUSSIAN_POSITION_NONE */
    struct tape tape;
    int trunk, gamma;             /* maps: of the trunk, with gamma behind */
};

/* Declare the tensors: numbers per point [h_k, d_k, ...]; the trunk's width,
 * 256 in the paper, and each attribute's hidden one, 128. */
void mlp_decoder_init(struct mlp_decoder *d, struct params *ps,
                      const char *prefix, size_t in, size_t width,
                      size_t hidden, struct gaussian_head head);
/* For batch items of `points` rows each. */
int mlp_decoder_plan(struct mlp_decoder *d, size_t batch, size_t points,
                     struct nn_options opt, struct error *err);
/* Free what _init and _plan allocated; zeroed then. */
void mlp_decoder_release(struct mlp_decoder *d);

/* out (B,N,...) from features (B,N,in), dir (B,3), rgb_logit (B,N,3) or NULL;
 * features must stay as they are until the backward. */
void mlp_decoder_forward(struct gaussian_out *out, const float *features,
                         const float *dir, const float *rgb_logit,
                         struct mlp_decoder *d);
/* dfeatures (B,N,in), ddir (B,3): written, or NULL. */
void mlp_decoder_backward(float *dfeatures, float *ddir,
                          const struct gaussian_out *dout, const float *dir,
                          const float *rgb_logit, struct mlp_decoder *d);

/* The same as a graph of N points: "features" (N,in), "direction" (1,3) and
 * "rgb_logit" (N,3) to the attributes (gaussian_head_graph). */
void mlp_decoder_graph(struct graph *g, size_t N,
                       const struct mlp_decoder *d);

#endif
