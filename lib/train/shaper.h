/* People's shapes as E_beta sees them, in place of the true ones: after its
 * own training it is frozen, and the rest of the model learns with what it
 * says (Section 3.3). */
#ifndef SPID_TRAIN_SHAPER_H
#define SPID_TRAIN_SHAPER_H

#include "lib/track/encoders.h"
#include "lib/train/data.h"

struct shaper {
    struct encoders encoders;
    float *crop;                /* (224,224,3) */
};

/* E_beta of a model file. */
int shaper_open(struct shaper *s, const char *model, struct error *err);
void shaper_close(struct shaper *s);

/* p->shape by E_beta from p's first frame, the source.  A data_shape_fn; ctx
 * is the struct shaper. */
int shaper_apply(void *ctx, struct data_person *p, struct error *err);

#endif
