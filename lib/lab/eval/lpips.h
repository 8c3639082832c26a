/* LPIPS (Zhang et al. 2018) with AlexNet features, when its weights are
 * given: a safetensors file with torchvision's "features.{0,3,6,8,10}.weight"
 * and ".bias" and the LPIPS package's "lin{0..4}.model.1.weight". */
#ifndef SPID_LAB_EVAL_LPIPS_H
#define SPID_LAB_EVAL_LPIPS_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/arena.h"
#include "lib/base/error.h"
#include "lib/lab/eval/tape.h"

#define LPIPS_STAGES 5

struct lpips {
    struct params ps;
    struct tape tape;
    int map[LPIPS_STAGES];              /* what each stage makes */
    size_t lin[LPIPS_STAGES];           /* tensors: (1,C,1,1) */
    size_t H, W;                        /* as planned; 0: not yet */
    bool learns;                        /* planned for a gradient: set before
                                         * the first distance */
    float *in, *din;                    /* a picture with a border */
    float *first[LPIPS_STAGES];         /* features of the first picture */
    float *d[LPIPS_STAGES];             /* gradients by the second's */
    struct arena memory;                /* of these */
};

/* Declare the tensors, by torchvision's and LPIPS's names. */
void lpips_declare(struct lpips *l);
/* Load the weights; EX_DATAERR names a tensor that is missing. */
int lpips_init(struct lpips *l, const char *path, struct error *err);
/* Free what it holds; zeroed then. */
void lpips_release(struct lpips *l);

/* Mean over n places of sum_c w_c (a_c/|a| - b_c/|b|)^2, their features a and b
 * (n,C); w (C) or NULL, all 1.  g (n,C), unless NULL, += the gradient by b. */
double lpips_feature_distance(float *g, const float *a, const float *b,
                              const float *w, size_t n, size_t C);
/* Distance of two planar pictures (3,H,W) in [0,1], both sides 64 or more. */
int lpips_distance(double *distance, struct lpips *l, const float *a,
                   const float *b, size_t H, size_t W, struct error *err);
/* db (3,H,W) = the gradient of the last distance by its second picture;
 * l->learns.  The weights are constants. */
void lpips_backward(float *db, struct lpips *l);

#endif
