/* ResNet-50 (He et al. 2015), its strides in the convolutions of 3 x 3, as a
 * pyramid of maps under the names of torchvision and timm.  Inference only.
 *
 * Level 0 is the stem at half the picture's size, 64 channels wide; levels 1 to
 * 4 are the stages, 256 to 2048 wide, each half as large as the one before. */
#ifndef SPID_LAB_EVAL_RESNET_H
#define SPID_LAB_EVAL_RESNET_H

#include <stddef.h>

#include "lib/lab/eval/max_pool.h"
#include "lib/nn/conv.h"
#include "lib/nn/norm.h"
#include "lib/nn/params.h"
#include "lib/nn/plan.h"

#define RESNET_LEVELS 5
#define RESNET_BLOCKS 16

/* x = relu(conv3(relu(conv2(relu(conv1 x)))) + (down x, or x)), a batch norm
 * folded into each. */
struct resnet_block {
    struct conv conv[3], down;
    struct batch_norm norm[3], norm_down;
};

struct resnet_level {
    size_t h, w, channels;
    float *map;                 /* (h,w,channels) */
    float *narrow[2];           /* within a block */
};

struct resnet {
    struct conv stem;
    struct batch_norm norm;
    struct resnet_block block[RESNET_BLOCKS];
    /* as planned */
    struct max_pool pool;
    float *padded, *pooled;     /* the stem's map below and right of zeros */
    struct resnet_level level[RESNET_LEVELS];
};

/* Declare "<at>conv1.weight" to "<at>layer4.2.bn3.running_var". */
void resnet_init(struct resnet *n, struct params *ps, const char *at);
/* A level for pictures of H x W, 3 pixels or more, behind the levels before it.
 * Its map may be recycled when the next level is planned. */
void resnet_plan(struct resnet *n, int level, struct nn_plan *p, size_t H,
                 size_t W);
/* A level's map; level 0 from rgb (H,W,3), the others from the one before. */
void resnet_forward(struct resnet *n, int level, const float *rgb);

#endif
