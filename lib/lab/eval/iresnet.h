/* The face recognition network whose embeddings ArcFace similarity compares:
 * the public "iresnet" layout (18 to 200 layers), weights under its names.
 * Every size follows from the file.  Inference only. */
#ifndef SPID_LAB_EVAL_IRESNET_H
#define SPID_LAB_EVAL_IRESNET_H

#include <stddef.h>

#include "lib/nn/tape.h"

#define IRESNET_SIDE 112        /* pixels of the aligned face */

struct iresnet {
    struct params ps;
    struct tape tape;
    int code;                   /* the map that is an embedding */
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
