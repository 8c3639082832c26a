/* How far two pictures are apart in a network's features, each pixel's channels
 * scaled to length 1, squared differences summed over channels and averaged over
 * pixels (Zhang et al. 2018).
 *
 * LPIPS itself is AlexNet's five layers with the learned weights of their
 * channels: a safetensors file with torchvision's "features.{0,3,6,8,10}.weight"
 * and ".bias" and the LPIPS package's "lin{0..4}.model.1.weight".  Of SqueezeNet
 * 1.0 seven layers and all their channels count alike, for those weights belong
 * to other networks: a file of lib/lab/eval/squeezenet.h's tensors. */
#ifndef SPID_LAB_EVAL_LPIPS_H
#define SPID_LAB_EVAL_LPIPS_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/arena.h"
#include "lib/base/error.h"
#include "lib/nn/tape.h"

#define LPIPS_LAYERS 7          /* at most */

enum lpips_net { LPIPS_ALEXNET, LPIPS_SQUEEZENET };

struct lpips {
    struct params ps;
    struct tape tape;
    enum lpips_net net;
    int layers, map[LPIPS_LAYERS];      /* the layers compared */
    size_t lin[LPIPS_LAYERS];           /* tensors (1,C,1,1); NN_NONE: none */
    size_t H, W;                        /* as planned; 0: not yet */
    bool learns;                        /* planned for a gradient: set before
                                         * the first distance */
    float *in, *din;                    /* a picture with a border */
    float *first[LPIPS_LAYERS];         /* features of the first picture */
    float *d[LPIPS_LAYERS];             /* gradients by the second's */
    struct arena memory;                /* of these */
};

/* Declare the tensors, by torchvision's and LPIPS's names. */
void lpips_declare(struct lpips *l, enum lpips_net net);
/* Load the weights; EX_DATAERR names a tensor that is missing. */
int lpips_init(struct lpips *l, enum lpips_net net, const char *path,
               struct error *err);
/* Free what it holds; zeroed then. */
void lpips_release(struct lpips *l);

/* Distance of two planar pictures (3,H,W) in [0,1], both sides 64 or more: the
 * sum over layers. */
int lpips_distance(double *distance, struct lpips *l, const float *a,
                   const float *b, size_t H, size_t W, struct error *err);
/* Its parts: a plan for pictures of a size; the first picture; and, as often as
 * wanted, the second one's distance from it. */
int lpips_plan(struct lpips *l, size_t H, size_t W, struct error *err);
void lpips_first(struct lpips *l, const float *rgb);
double lpips_second(struct lpips *l, const float *rgb);
/* db (3,H,W) = the gradient of the last distance by its second picture;
 * l->learns.  The weights are constants. */
void lpips_backward(float *db, struct lpips *l);

#endif
