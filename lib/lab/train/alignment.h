/* L_lmk of Section 3.3: where a frozen face alignment network sees the 68
 * landmarks of what was drawn, against where it sees those of the true
 * picture, in sides of its heat maps (64 pixels).
 *
 * A landmark is the centre of mass of the positive values within three pixels
 * of its map's largest, as wide as the Gaussians that the network learned: the
 * noise of a whole map does not pull it, and it has a gradient. */
#ifndef SPID_LAB_TRAIN_ALIGNMENT_H
#define SPID_LAB_TRAIN_ALIGNMENT_H

#include "lib/base/crop.h"
#include "lib/lab/train/fan.h"

/* The side of the square that the network was trained with, twice the
 * landmarks' box, over the face crop's. */
#define ALIGNMENT_GROW 1.3

struct alignment {
    struct params ps;
    struct tape net;              /* lib/lab/train/fan.h */
    int heat;                     /* its map */
    size_t side;                  /* of the network's picture; 0: none */
    struct nn_plan plan;
    float *crop, *dcrop;          /* (side,side,3) */
    float *grid;                  /* (side,side,2) where its pixels lie */
    float *dheat;                 /* (side/4,side/4,68) */
    double target[FAN_LANDMARKS][2];    /* x, y in heat map pixels */
    bool seen[FAN_LANDMARKS];
};

/* The network's weights from `path`, on pictures of side x side pixels
 * (FAN_SIDE; less for tests).  Errors name the file and its tensor; nothing is
 * left allocated then. */
int alignment_open(struct alignment *a, const char *path, size_t side,
                   struct error *err);
/* Free what it holds; zeroed then. */
void alignment_release(struct alignment *a);

/* The landmarks in square q of a picture (H,W,3), 0..1, are what the following
 * losses are against. */
void alignment_target(struct alignment *a, const float *rgb, size_t H,
                      size_t W, struct square q);
/* weight * the mean over landmarks of their squared distance, in sides of the
 * maps, in the same square of a picture; adds its gradient to drgb.  A landmark
 * whose map is nowhere positive in one of the two counts 0. */
double alignment_loss(float *drgb, const float *rgb, size_t H, size_t W,
                      struct square q, double weight, struct alignment *a);

#endif
