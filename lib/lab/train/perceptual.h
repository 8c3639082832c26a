/* L_perc of Section 3.3 with a real network: how far two pictures are apart in
 * its features, each pixel's channels scaled to length 1, squared differences
 * summed over channels and averaged over pixels (Zhang et al. 2018).
 *
 * Either LPIPS itself, AlexNet with the learned weights of its channels, the
 * sum over five layers (lib/lab/eval/lpips.h), or seven layers of SqueezeNet 1.0,
 * where all layers and channels count alike, for LPIPS's weights belong to
 * other networks.  The file's tensors say which. */
#ifndef SPID_LAB_TRAIN_PERCEPTUAL_H
#define SPID_LAB_TRAIN_PERCEPTUAL_H

#include "lib/lab/data/box.h"
#include "lib/lab/eval/lpips.h"
#include "lib/lab/eval/squeezenet.h"

#define PERCEPTUAL_LAYERS 7

struct perceptual {
    struct params ps;
    struct squeezenet net;
    size_t side;                  /* pixels the box is brought to */
    struct nn_plan plan;
    float *crop, *dcrop;          /* (side,side,3) */
    float *target[PERCEPTUAL_LAYERS];   /* (h,w,C) */
    float *grad[PERCEPTUAL_LAYERS];     /* (h,w,C) */
    bool weighed;                 /* by LPIPS, in place of net: */
    struct lpips lpips;
    float *planar[3];             /* (3,side,side): target, picture, gradient */
};

/* The network's weights from `path`, for boxes brought to side x side pixels.
 * Errors name the file and its tensor; nothing is left allocated then. */
int perceptual_open(struct perceptual *p, const char *path, size_t side,
                    struct error *err);
/* Free what it holds; zeroed then. */
void perceptual_release(struct perceptual *p);

/* Picture a (H,W,3), 0..1, inside the box (NULL: all of it) is what the
 * following losses are against. */
void perceptual_target(struct perceptual *p, const float *a, size_t H,
                       size_t W, const struct box *box);
/* weight * the distance (of SqueezeNet the mean over layers) for picture b of
 * the same size and box; adds weight times the gradient to db (NULL: none is
 * wanted).  An empty box: 0. */
double perceptual_loss(float *db, const float *b, size_t H, size_t W,
                       const struct box *box, double weight,
                       struct perceptual *p);

#endif
