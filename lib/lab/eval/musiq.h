/* MUSIQ (Ke et al. 2021), the quality of one picture by a transformer over its
 * patches at three sizes, when its weights are given: a safetensors file of
 * spid-import --as musiq, networks that end in one number (koniq10k's is from
 * 0 to 100).
 *
 * The picture counts as 2 rgb - 1, at its longer side's 224 and 384 pixels
 * (Keys' bicubic of a = -0.75, not widened where it shrinks; edges repeated)
 * and as it is.  Each size is cut into patches of 32 x 32, zeros (mid grey)
 * around it where the sides are no multiples, as many on both sides, an odd one
 * behind.  A patch alone passes a convolution, a maximum and a bottleneck of
 * ResNet with group norms, and one linear layer; its place, hashed to a grid of
 * 10 x 10, and its size are added.  Padding tokens, which public code masks
 * out, are not made. */
#ifndef SPID_LAB_EVAL_MUSIQ_H
#define SPID_LAB_EVAL_MUSIQ_H

#include <stddef.h>

#include "lib/base/error.h"
#include "lib/lab/eval/max_pool.h"
#include "lib/nn/attention.h"
#include "lib/nn/conv.h"
#include "lib/nn/norm.h"
#include "lib/nn/params.h"
#include "lib/nn/rescale.h"
#include "lib/nn/transformer.h"

#define MUSIQ_SCALES 3
#define MUSIQ_BLOCKS 14

struct musiq {
    struct params ps;
    struct nn_plan plan;
    struct conv root, conv1, conv2, conv3, proj, embedding, head;
    struct layer_norm gn_root, gn1, gn2, gn3, gn_proj;  /* of groups; */
    struct layer_norm norm;                             /* of all */
    size_t position, scale, cls;
    struct transformer block[MUSIQ_BLOCKS];
    struct attention attention;
    size_t H, W;                /* as planned; 0: not yet */
    size_t h[MUSIQ_SCALES], w[MUSIQ_SCALES];
    size_t patches;             /* of all sizes; tokens are one more */
    struct rescale resize[MUSIQ_SCALES];
    struct max_pool pool;
    float *picture, *size[MUSIQ_SCALES];        /* (H,W,3), (h,w,3) */
    float *rgb;                                 /* (patches,32,32,3) */
    float *root_out, *narrow[3], *wide[2];      /* of every patch */
    float *x, *n, *hidden, *quality; /* of every token */
};

/* Load the weights; EX_DATAERR names a tensor that is missing. */
int musiq_init(struct musiq *m, const char *path, struct error *err);
/* Declare the file's tensors. */
void musiq_declare(struct musiq *m);
/* Free what it holds; zeroed then. */
void musiq_release(struct musiq *m);

/* Quality of a planar picture (3,H,W) in [0,1], higher is better. */
int musiq_quality(double *quality, struct musiq *m, const float *rgb,
                  size_t H, size_t W, struct error *err);

#endif
