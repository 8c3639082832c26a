/* The losses of Section 3.3 on pictures, each with its gradient.  Pictures are
 * (H,W,3) rows of channels.  Every function returns weight * loss and adds
 * weight times the gradient to db (NULL: none is wanted). */
#ifndef SPID_LAB_TRAIN_LOSSES_H
#define SPID_LAB_TRAIN_LOSSES_H

#include <stddef.h>

#include "lib/lab/data/box.h"

/* Mean |b - a| over the box (NULL: everything): L_img's four terms. */
double loss_l1(float *db, const float *b, const float *a, size_t H, size_t W,
               const struct box *box, double weight);
/* Mean (b - a)^2 of n numbers: colours, or the silhouette's alpha. */
double loss_l2(float *db, const float *b, const float *a, size_t n,
               double weight);

#define LOSS_LEVELS 4

/* Laplacian-pyramid L1, the stand-in for L_perc: sum over LOSS_LEVELS scales
 * of the mean |band| of b - a inside the box, plus the mean |rest|.  Sides of
 * the box under 2^LOSS_LEVELS use fewer scales.  tmp holds
 * loss_pyramid_scratch(box) floats. */
size_t loss_pyramid_scratch(size_t H, size_t W);
/* The loss itself; db (H,W,3; may be NULL) += its gradient times weight. */
double loss_pyramid(float *db, const float *b, const float *a, size_t H,
                    size_t W, const struct box *box, double weight,
                    float *tmp);

#endif
