/* MobileNetV3 feature extractors, as timm names and builds them:
 * "mobilenetv3_small_100", "tf_mobilenetv3_small_minimal_100" (576 features),
 * "tf_mobilenetv3_large_minimal_100" (960); "mobilenetv3_small_150" (864) is
 * the first by timm's channel multiplier.  Tensors have timm's names. */
#ifndef SPID_NET_MOBILENET_H
#define SPID_NET_MOBILENET_H

#include "lib/nn/graph.h"
#include "lib/nn/nn.h"
#include "lib/nn/params.h"

struct mobilenet_impl;

struct mobilenet {
    size_t features;              /* of the last stage */
    size_t batch, height, width;  /* as planned */
    size_t out_h, out_w;          /* of the last stage */
    struct mobilenet_impl *impl;
};

/* Fails (EX_CONFIG) when the variant is unknown. */
int mobilenet_init(struct mobilenet *m, struct params *ps, const char *prefix,
                   const char *variant, struct error *err);
/* The same layers on the same tensors, to be planned and released on their own;
 * `of` has not been planned yet.  EX_OSERR. */
int mobilenet_copy(struct mobilenet *m, const struct mobilenet *of,
                   struct error *err);
/* Pictures of height x width. */
int mobilenet_plan(struct mobilenet *m, size_t batch, size_t height,
                   size_t width, struct nn_options opt, struct error *err);
/* Free what _init and _plan allocated; zeroed then. */
void mobilenet_release(struct mobilenet *m);

/* pooled (B,features) = mean over the last stage of rgb (B,H,W,3) in [0,1].
 * NN_TRAIN: batch statistics; the running ones move by 0.1 (PyTorch's
 * momentum 0.1, unbiased variance). */
void mobilenet_forward(float *pooled, const float *rgb, struct mobilenet *m);
/* drgb (B,H,W,3), or NULL, from dpooled (B,features); weight gradients are
 * added. */
void mobilenet_backward(float *drgb, const float *dpooled,
                        struct mobilenet *m);

/* The stages golden 01 lists (0..4; 4 is the last, before pooling): the
 * activation of the last forward, (B,h,w,c), NN_TRAIN and NN_FROZEN only. */
const float *mobilenet_stage(size_t shape[4], const struct mobilenet *m,
                             int stage);
/* Gradient from the last stage's map (B,out_h,out_w,features), not pooled. */
void mobilenet_backward_features(float *drgb, const float *dfeatures,
                                 struct mobilenet *m);

/* The same layers as a graph: mean over the last stage (B,features) from maps
 * of the picture. */
int mobilenet_graph(struct graph *g, int maps, const struct mobilenet *m);

#endif
