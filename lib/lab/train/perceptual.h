/* L_perc of Section 3.3 with a real network (lib/lab/eval/lpips.h), in a box of
 * two pictures: either LPIPS itself, the sum over its layers, or the mean over
 * SqueezeNet's.  The file's tensors say which. */
#ifndef SPID_LAB_TRAIN_PERCEPTUAL_H
#define SPID_LAB_TRAIN_PERCEPTUAL_H

#include "lib/lab/data/box.h"
#include "lib/lab/eval/lpips.h"

struct perceptual {
    struct lpips net;
    size_t side;                  /* pixels the box is brought to */
    float *crop, *dcrop;          /* (3,side,side) */
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
/* weight * the distance for picture b of the same size and box; adds weight
 * times the gradient to db (NULL: none is wanted).  An empty box: 0. */
double perceptual_loss(float *db, const float *b, size_t H, size_t W,
                       const struct box *box, double weight,
                       struct perceptual *p);

#endif
