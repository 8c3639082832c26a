/* E_beta's opinion from several looks at one picture: the face crop a little
 * to each side, and all of it in a mirror.  Their mean is nearer the truth
 * than any one of them. */
#ifndef SPID_TRACK_LOOKS_H
#define SPID_TRACK_LOOKS_H

#include <stddef.h>

#include "lib/base/error.h"
#include "lib/geom/crop.h"
#include "lib/head/head.h"
#include "lib/net/shape_encoder.h"

/* rgb (224,224,3) in [0,1] = square q of the picture that ctx knows. */
typedef int look_fn(void *ctx, float *rgb, struct square q,
                    struct error *err);

struct looks {
    struct shape_encoder *net;          /* borrowed, planned for one crop */
    float sign[SHAPE_ENCODER_OUT];      /* of head_mirror */
    int mirror;                         /* the head has such signs */
    float *rgb;                         /* (224,224,3) */
};

int looks_init(struct looks *l, struct shape_encoder *net,
               const struct head *h, struct error *err);
void looks_release(struct looks *l);

/* beta (300) of the face in crop q; -1 only when fn fails. */
int looks_shape(float *beta, struct looks *l, struct square q, look_fn *fn,
                void *ctx, struct error *err);

/* The mirror image of rgb (n,n,3), in place. */
void looks_mirror(float *rgb, size_t n);

#endif
