/* The encoders' opinions from several looks at one picture: the face crop a
 * little to each side (E_beta), and in a mirror (both).  Their mean is nearer
 * the truth than any one of them. */
#ifndef SPID_TRACK_LOOKS_H
#define SPID_TRACK_LOOKS_H

#include <stddef.h>

#include "lib/base/error.h"
#include "lib/geom/crop.h"
#include "lib/head/mirror.h"
#include "lib/net/motion_encoder.h"
#include "lib/net/shape_encoder.h"

/* rgb (224,224,3) in [0,1] = square q of the picture that ctx knows. */
typedef int look_fn(void *ctx, float *rgb, struct square q,
                    struct error *err);

struct looks {
    struct shape_encoder *net;          /* borrowed, planned for one crop */
    struct head_mirror across;
    int mirror;                         /* across is of use */
    float *rgb;                         /* (224,224,3) */
};

int looks_init(struct looks *l, struct shape_encoder *net,
               const struct head *h, struct error *err);
void looks_release(struct looks *l);

/* beta (300) of the face in crop q; -1 only when fn fails. */
int looks_shape(float *beta, struct looks *l, struct square q, look_fn *fn,
                void *ctx, struct error *err);

/* out (n,n,3) = the mirror image of rgb; they may be the same. */
void looks_mirror(float *out, const float *rgb, size_t n);

/* What E_m's row says of the mirrored person. */
struct motion_mirror {
    int from[MOTION_OUT];
    float sign[MOTION_OUT];
};

/* 1; 0 when h's expressions have no mirror images; -1 when memory is short. */
int motion_mirror_init(struct motion_mirror *m, const struct head *h,
                       struct error *err);
/* out (120) = mean of out and of what E_m says of the mirrored crop (120). */
void motion_mirror_mean(float *out, const float *mirrored,
                        const struct motion_mirror *m);

/* E_m with its second look: crops and their mirror images are one batch. */
struct motion_looks {
    struct motion_encoder *net;         /* borrowed */
    size_t batch;                       /* B crops at a time */
    struct motion_mirror across;
    int mirror;                         /* across is of use, and wanted */
    float *rgb, *said;                  /* (2B,224,224,3); (2B,120) */
};

/* once: no second look.  net has been planned; it is planned again where its
 * batch is not what this needs. */
int motion_looks_init(struct motion_looks *l, struct motion_encoder *net,
                      size_t batch, const struct head *h, int once,
                      struct error *err);
void motion_looks_release(struct motion_looks *l);
/* out (B,120) of crops rgb (B,224,224,3). */
void motion_looks_see(float *out, struct motion_looks *l, const float *rgb);

#endif
