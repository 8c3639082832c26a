/* People's shapes as E_beta sees them, in place of the true ones: after its
 * own training it is frozen, and the rest of the model learns with what it
 * says (Section 3.3). */
#ifndef SPID_TRAIN_SHAPER_H
#define SPID_TRAIN_SHAPER_H

#include "lib/track/encoders.h"
#include "lib/track/looks.h"
#include "lib/train/data.h"

struct shaper {
    struct encoders encoders;
    struct looks looks;
};

/* E_beta of a model file, for people with head h (borrowed). */
int shaper_open(struct shaper *s, const char *model, const struct head *h,
                struct error *err);
void shaper_close(struct shaper *s);

/* p->shape by E_beta from p's first frame, the source.  A data_shape_fn; ctx
 * is the struct shaper. */
int shaper_apply(void *ctx, struct data_person *p, struct error *err);

/* beta (300) from one frame. */
int shaper_look(float *beta, struct looks *l, const struct data_frame *f,
                struct error *err);

#endif
