/* SqueezeNet 1.0 (Iandola et al. 2016) as features of a picture, for a
 * perceptual loss: a first convolution and eight fire modules, each a 1x1
 * convolution to few channels and a 1x1 and a 3x3 from them side by side.  The
 * weights are frozen; the backward goes to the picture.  Tensors have
 * torchvision's names, "<prefix>features.N.*". */
#ifndef SPID_LAB_EVAL_SQUEEZENET_H
#define SPID_LAB_EVAL_SQUEEZENET_H

#include "lib/lab/eval/tape.h"

#define SQUEEZENET_FIRES 8
#define SQUEEZENET_MIN 15     /* pixels of a side, for the last pool */

/* What the network can be asked for: the first convolution after its ReLU, and
 * the fire modules before their pools. */
enum squeezenet_layer {
    SQUEEZENET_RELU1, SQUEEZENET_FIRE2, SQUEEZENET_FIRE3, SQUEEZENET_FIRE4,
    SQUEEZENET_FIRE5, SQUEEZENET_FIRE6, SQUEEZENET_FIRE7, SQUEEZENET_FIRE8,
    SQUEEZENET_FIRE9, SQUEEZENET_LAYERS
};

struct squeezenet {
    struct tape tape;
    int layer[SQUEEZENET_LAYERS];           /* their maps */
};

/* Declare the tensors, "features.0.weight" and on, all frozen. */
void squeezenet_init(struct squeezenet *s, struct params *ps);
/* A picture of SQUEEZENET_MIN pixels a side or more. */
int squeezenet_plan(struct squeezenet *s, size_t height, size_t width,
                    struct nn_options opt, struct error *err);
/* Free what _init and _plan allocated; zeroed then. */
void squeezenet_release(struct squeezenet *s);

/* All layers of rgb (H,W,3), 0..1 sRGB, which must stay until the
 * backward. */
void squeezenet_forward(const float *rgb, struct squeezenet *s);
/* A layer of the last forward, (1,h,w,C) as in shape; NN_FROZEN plans. */
const float *squeezenet_layer(size_t shape[4], const struct squeezenet *s,
                              enum squeezenet_layer layer);
/* drgb (H,W,3) is written, from each layer's gradient, as squeezenet_layer
 * (NULL: zero). */
void squeezenet_backward(float *drgb,
                         const float *const dlayer[SQUEEZENET_LAYERS],
                         struct squeezenet *s);

#endif
