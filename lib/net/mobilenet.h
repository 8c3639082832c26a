/* MobileNetV3 feature extractors, as timm names and builds them:
 * "mobilenetv3_small_100", "tf_mobilenetv3_small_minimal_100" (576 features),
 * "tf_mobilenetv3_large_minimal_100" (960); "mobilenetv3_small_150" (864) is
 * the first by timm's channel multiplier.  Tensors have timm's names. */
#ifndef SPID_NET_MOBILENET_H
#define SPID_NET_MOBILENET_H

#include "lib/nn/tape.h"

struct mobilenet {
    struct tape tape;
    const char *variant;
    size_t features;              /* of the last stage */
    int stage[5];                 /* maps behind the stages that golden 01
                                   * lists; the last one before pooling */
};

/* Fails (EX_CONFIG) when the variant is unknown. */
int mobilenet_init(struct mobilenet *m, struct params *ps, const char *prefix,
                   const char *variant, struct error *err);
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

/* pooled (1,features) of a picture (1,H,W,3). */
int mobilenet_graph(struct graph *g, int picture, const struct mobilenet *m);

#endif
