/* The face recognition network whose embeddings ArcFace similarity compares:
 * the public "iresnet" layout (18 to 200 layers), weights under its names.
 * Every size follows from the file.  Inference only. */
#ifndef SPID_LAB_EVAL_IRESNET_H
#define SPID_LAB_EVAL_IRESNET_H

#include <stddef.h>

#include "lib/nn/conv.h"
#include "lib/nn/norm.h"
#include "lib/nn/params.h"
#include "lib/nn/plan.h"

#define IRESNET_SIDE 112        /* pixels of the aligned face */
#define IRESNET_MAX_BLOCKS 128

/* y = conv2(prelu(conv1(bn1 x))) + (down x, or x); the other norms are folded
 * into the convolution before them. */
struct iresnet_block {
    struct batch_norm bn1, bn2, bn3, bn_down;
    struct conv conv1, conv2, down;
    size_t prelu;               /* tensor (out) */
    bool has_down;
    size_t side, stride;        /* of the input */
};

struct iresnet {
    struct params ps;
    struct nn_plan plan;
    struct conv stem, fc;
    struct batch_norm bn_stem, bn_last, bn_feature;
    size_t prelu;
    struct iresnet_block block[IRESNET_MAX_BLOCKS];
    size_t blocks;
    float *x, *y, *t;           /* maps */
    float *code;                /* (embedding) */
};

/* Declare the tensors, as many and as wide as the file's, of which rows says
 * the first dimension, or 0 where one is not there.  EX_DATAERR names path and
 * such a tensor. */
int iresnet_declare(struct iresnet *n,
                    size_t rows(const void *file, const char *name),
                    const void *file, const char *path, struct error *err);
/* Load and plan.  EX_DATAERR names a tensor that is missing or whose shape
 * does not fit. */
int iresnet_open(struct iresnet *n, const char *path, struct error *err);
/* Free what _init and _plan allocated; zeroed then. */
void iresnet_release(struct iresnet *n);

/* Length of an embedding. */
size_t iresnet_size(const struct iresnet *n);

/* Unit embedding of an aligned face (112,112,3), RGB in [-1,1]. */
void iresnet_forward(float *embedding, const float *rgb, struct iresnet *n);

#endif
