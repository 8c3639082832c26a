/* TopIQ (Chen et al. 2023) without a reference, the quality of one picture by
 * what it shows, when its weights are given: a safetensors file of spid-import
 * --as topiq (koniq10k's is from about 0 to 1).
 *
 * The picture, at its own size and normalised as ImageNet's, passes ResNet-50.
 * Each level's map, gated pixel by pixel, is pooled to the size of the last one
 * and is tokens that attend to each other.  From the last level down to the
 * first, the tokens so far ask those of the next level (cross attention); the
 * mean of what comes out is the quality. */
#ifndef SPID_LAB_EVAL_TOPIQ_H
#define SPID_LAB_EVAL_TOPIQ_H

#include <stddef.h>

#include "lib/base/error.h"
#include "lib/lab/eval/resnet.h"
#include "lib/nn/attention.h"
#include "lib/nn/conv.h"
#include "lib/nn/norm.h"
#include "lib/nn/params.h"
#include "lib/nn/rescale.h"
#include "lib/nn/transformer.h"

/* In pictures of less, the stages of ResNet would not get smaller. */
#define TOPIQ_MIN 17

/* A level's way to its tokens. */
struct topiq_level {
    struct conv split, gate[3], reduce;
    struct rescale pool;
    struct transformer self;
    float *both, *half[2];      /* (h,w,2 C): what is gated, what gates it */
    float *narrow[2], *weight;  /* (h,w,...) */
    float *pooled, *tokens;     /* (T,...) */
};

/* Queries of the tokens so far, keys and values of the level below. */
struct topiq_cross {
    struct layer_norm norm;     /* of the level below */
    struct transformer query;
};

struct topiq {
    struct params ps;
    struct nn_plan plan;
    struct tape resnet;
    int map[RESNET_LEVELS];     /* its levels */
    struct topiq_level level[RESNET_LEVELS];
    struct topiq_cross cross[RESNET_LEVELS - 1];    /* as they are asked */
    struct transformer last;
    struct layer_norm score_norm[2];
    struct conv score[3];
    size_t row, column;         /* embeddings of places */
    struct attention attention;
    size_t H, W;                /* as planned; 0: not yet */
    size_t tokens;              /* T, those of every level */
    float *picture;             /* (H,W,3) */
    float *places;              /* (T,...), added to tokens */
    float *n, *qkv, *hidden;    /* of the transformers */
    float *mean[2], *quality;   /* of all tokens */
};

/* Load the weights; EX_DATAERR names a tensor that is missing. */
int topiq_init(struct topiq *t, const char *path, struct error *err);
/* Declare the file's tensors. */
void topiq_declare(struct topiq *t);
/* Free what it holds; zeroed then. */
void topiq_release(struct topiq *t);

/* Quality of a planar picture (3,H,W) in [0,1], sides of TOPIQ_MIN or more;
 * higher is better. */
int topiq_quality(double *quality, struct topiq *t, const float *rgb,
                  size_t H, size_t W, struct error *err);

#endif
