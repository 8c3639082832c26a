/* The way into the narrow refiner, for inference: its first layer, a 2x2
 * convolution of stride 2 with leaky relu, in one pass over the feature image
 * (by far the largest thing the refiner reads), which also picks out the
 * coarse picture and widens half floats on the way. */
#ifndef SPID_NN_FUSED_STEM_H
#define SPID_NN_FUSED_STEM_H

#include <stdbool.h>
#include <stdint.h>

#include "lib/nn/conv.h"

/* Feature images (B,h,w,C): floats, or half floats where f32 is NULL. */
struct feature_view {
    const float *f32;
    const uint16_t *f16;
    size_t stride;           /* values from row to row, at least w C */
    const float *alpha;      /* (B,h,w), rows stride / C apart: 0 where all of
                              * a pixel's features are zeros; or NULL */
    /* NULL, or only the covered pixels are there, one after another; the
     * others are zeros (lib/base/covered.h) */
    const size_t *start;     /* (B h) how many come before each row */
};

struct fused_stem {
    const struct conv *c;    /* declares the weights */
    size_t batch, h, w;      /* of the input */
    float *weight;           /* (out/16, 4 in, 16) */
    float *bias;             /* (out) */
    float *empty;            /* (out) where all features are zeros */
    float *wide;             /* widened half floats, for every thread */
    size_t line;             /* floats of one thread's */
};

/* A piece of two rows, as the kernel reads it. */
struct fused_stem_rows {
    const float *row[2];     /* (2 pixels, C) each */
    const char *next[2];     /* what follows in memory, a piece later */
    size_t step;             /* bytes of 16 values there */
};

/* Whether c is such a layer: out a multiple of 16. */
bool fused_stem_possible(const struct conv *c);
/* Feature images (batch,h,w,in) for the layer c, which is not planned. */
void fused_stem_plan(struct fused_stem *f, const struct conv *c,
                     struct nn_plan *p, size_t batch, size_t h, size_t w);
/* out (B,h/2,w/2,out); rgb (B,h,w,3) <- the first three channels. */
void fused_stem_forward(float *out, float *rgb, const struct feature_view *in,
                        const struct fused_stem *f);
/* rgb alone. */
void fused_stem_pick(float *rgb, const struct feature_view *in,
                     const struct fused_stem *f);

#endif
