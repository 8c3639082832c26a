/* People's shapes as E_beta predicts them, in place of the true ones: after
 * its own training it is frozen, and the rest of the model learns with its
 * predictions (Section 3.3). */
#ifndef SPID_LAB_TRAIN_PREDICTED_SHAPE_H
#define SPID_LAB_TRAIN_PREDICTED_SHAPE_H

#include "lib/lab/data/data.h"
#include "lib/track/encoders.h"
#include "lib/track/tta.h"
#include "lib/lab/train/shape_loss.h"

struct predicted_shape {
    struct encoders encoders;
    struct shape_tta tta;
    struct shape_place place;
};

/* E_beta of a model file, for people with head h (borrowed). */
int predicted_shape_open(struct predicted_shape *s, const char *path,
                         const struct head *h, struct error *err);
/* Free what it holds. */
void predicted_shape_close(struct predicted_shape *s);

/* p->shape by E_beta from p's first frame, the source, and every frame's
 * translation such that a head of this shape lies in the picture where the
 * true one does: size and distance look the same.  A data_shape_fn; ctx is the
 * struct predicted_shape. */
int predicted_shape_apply(void *ctx, struct data_person *p,
                          struct error *err);

#endif
