/* SqueezeNet 1.0 (Iandola et al. 2016) as features of a picture: a first
 * convolution and eight fire modules, each a 1x1 convolution to few channels and
 * a 1x1 and a 3x3 from them side by side.  Tensors have torchvision's names,
 * "features.N.*". */
#ifndef SPID_LAB_EVAL_SQUEEZENET_H
#define SPID_LAB_EVAL_SQUEEZENET_H

#include "lib/nn/tape.h"

#define SQUEEZENET_FIRES 8

/* What the network can be asked for: the first convolution after its ReLU, and
 * the fire modules before their pools. */
enum squeezenet_layer {
    SQUEEZENET_RELU1, SQUEEZENET_FIRE2, SQUEEZENET_FIRE3, SQUEEZENET_FIRE4,
    SQUEEZENET_FIRE5, SQUEEZENET_FIRE6, SQUEEZENET_FIRE7, SQUEEZENET_FIRE8,
    SQUEEZENET_FIRE9, SQUEEZENET_LAYERS
};

/* Its steps on a new tape, whose pictures are 0..1 sRGB of 15 pixels a side or
 * more; layer: their maps. */
void squeezenet_declare(int layer[SQUEEZENET_LAYERS], struct tape *t);

#endif
