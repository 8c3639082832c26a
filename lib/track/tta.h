/* Test-time augmentation of the encoders: E_beta's mean over crops a little
 * apart and over mirror images, E_m's over a crop and its mirror image.  The
 * mean is nearer the truth than any one output. */
#ifndef SPID_TRACK_TTA_H
#define SPID_TRACK_TTA_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/error.h"
#include "lib/base/crop.h"
#include "lib/head/mirror.h"
#include "lib/head/motion.h"
#include "lib/net/light_net.h"
#include "lib/net/motion_encoder.h"
#include "lib/net/shape_encoder.h"

/* out (n,n,3) = the mirror image of rgb; they may be the same. */
void tta_mirror_picture(float *out, const float *rgb, size_t n);

/* ---- E_beta ------------------------------------------------------------- */

/* rgb (224,224,3) in [0,1] = square q of the picture that ctx knows. */
typedef int tta_crop_fn(void *ctx, float *rgb, struct square q,
                        struct error *err);

struct shape_tta {
    struct shape_encoder *net;          /* borrowed, planned for one crop */
    struct head_mirror across;
    bool mirror;                        /* whether `across` is set */
    float *rgb;                         /* (224,224,3) */
};

/* For faces of head h; mirror images are left out where its shapes have
 * none. */
int shape_tta_init(struct shape_tta *t, struct shape_encoder *net,
                   const struct head *h, struct error *err);
/* Free what it holds. */
void shape_tta_release(struct shape_tta *t);

/* beta (300) of the face in crop q; -1 only when crop fails. */
int shape_tta_forward(float *beta, struct shape_tta *t, struct square q,
                      tta_crop_fn *crop, void *ctx, struct error *err);

/* m's light, of the face in crop q; unknown to a net without tensors.  -1 only
 * when memory is short or crop fails. */
int light_of_crop(struct motion *m, const struct light_net *net,
                  struct square q, tta_crop_fn *crop, void *ctx,
                  struct error *err);

/* ---- E_m ---------------------------------------------------------------- */

/* Which output of the mirrored picture stands for which, and with which
 * sign. */
struct motion_mirror {
    bool known;                 /* both are set */
    int from[MOTION_OUT];
    float sign[MOTION_OUT];
};

/* 1; 0 when h's expressions have no mirror images; -1 when memory is short. */
int motion_mirror_init(struct motion_mirror *m, const struct head *h,
                       struct error *err);
/* out (120) = mean of out and of E_m's output for the mirrored crop (120). */
void motion_mirror_mean(float *out, const float *mirrored,
                        const struct motion_mirror *m);

/* E_m on crops and their mirror images, as one batch. */
struct motion_tta {
    struct motion_encoder *net;         /* borrowed */
    size_t batch;                       /* B crops at a time */
    struct motion_mirror across;        /* known where it is wanted */
    float *rgb, *raw;                   /* (2B,224,224,3); (2B,120) */
    bool compared, looked;              /* own and added are set; by the last
                                         * picture */
    float own[MOTION_OUT];              /* E_m's output for a picture, */
    float added[MOTION_OUT];            /* what its mirror image changed */
};

/* wanted false: the crops alone.  shared: NULL, or h's mirror, which who finds it
 * leaves to the others.  quick: a net of type NN_FAST multiplies in
 * bfloat16 where the processor has instructions for that; its rounding is a
 * sixth of the noise of poses from frame to frame.  net, which has been
 * planned, is planned again where its batch or type is not what this needs.
 * EX_OSERR. */
int motion_tta_init(struct motion_tta *t, struct motion_encoder *net,
                    size_t batch, const struct head *h, bool wanted,
                    struct motion_mirror *shared, bool quick,
                    struct error *err);
/* Free what it holds. */
void motion_tta_release(struct motion_tta *t);
/* out (B,120) of crops rgb (B,224,224,3). */
void motion_tta_forward(float *out, struct motion_tta *t, const float *rgb);
/* The same of a crop (B = 1) of the picture that follows the last one.  The
 * mirror image corrects what E_m makes of a face, of its light and its features,
 * and these stay: where the face has hardly moved since it was looked at,
 * the correction is that of then. */
void motion_tta_follow(float *out, struct motion_tta *t, const float *rgb);
/* How sure E_m was of the first of them, its mirror image counted in where that
 * was looked at. */
float motion_tta_confidence(const struct motion_tta *t);

#endif
