/* People's shapes as E_beta sees them, in place of the true ones: after its
 * own training it is frozen, and the rest of the model learns with what it
 * says (Section 3.3). */
#ifndef SPID_TRAIN_SHAPER_H
#define SPID_TRAIN_SHAPER_H

#include "lib/track/encoders.h"
#include "lib/track/tta.h"
#include "lib/data/data.h"
#include "lib/train/shape_loss.h"

struct shaper {
    struct encoders encoders;
    struct shape_tta looks;
    struct shape_place place;
};

/* E_beta of a model file, for people with head h (borrowed). */
int shaper_open(struct shaper *s, const char *path, const struct head *h,
                struct error *err);
void shaper_close(struct shaper *s);

/* p->shape by E_beta from p's first frame, the source, and every frame's
 * translation such that a head of this shape lies in the picture where the
 * true one does: size and distance look the same.  A data_shape_fn; ctx is the
 * struct shaper. */
int shaper_apply(void *ctx, struct data_person *p, struct error *err);

/* beta (300) of the face in crop q of a frame. */
int shaper_look(float *beta, struct shape_tta *l, const struct data_frame *f,
                struct square q, struct error *err);

#endif
