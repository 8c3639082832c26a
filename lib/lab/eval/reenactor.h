/* A whole model at work on frames with known truth: its encoders in float,
 * then what ships, baker (Phase A) and pipeline (Phase B), with features in
 * float. */
#ifndef SPID_LAB_EVAL_REENACTOR_H
#define SPID_LAB_EVAL_REENACTOR_H

#include <stddef.h>

#include "lib/animate/pipeline.h"
#include "lib/avatar/baker.h"
#include "lib/base/densify.h"
#include "lib/base/error.h"
#include "lib/head/lbs.h"
#include "lib/lab/data/data.h"
#include "lib/net/model.h"
#include "lib/photo/texture.h"
#include "lib/track/encoders.h"
#include "lib/track/tta.h"

/* What may be taken from the data instead of the encoders, to tell their share
 * of an error from the branches'. */
enum { REENACTOR_TRUE_SHAPE = 1, REENACTOR_TRUE_MOTION = 2 };
/* Add "shape" or "motion" to *bits; -1 and EX_USAGE for another word. */
int reenactor_parse_truth(const char *word, void *bits, struct error *err);

/* The head as a frame drives it. */
struct driven {
    struct motion motion;
    float cam[12];              /* of the portrait window */
    float *verts;               /* (V,3), the caller's */
};

struct reenactor {
    const struct head *head;
    const struct model *model;
    unsigned truth;             /* REENACTOR_TRUE_* */
    const float *beta;          /* the true shape (head.nshape) then */

    struct encoders nets;
    struct shape_tta shape_tta;         /* as spid-shape and spid-motion */
    struct motion_tta motion_tta;
    struct baker baker;
    struct densify dense;
    float *crop;                /* (224,224,3) */
    float *verts;               /* (V,3) of the source */

    /* of the source */
    struct person person;
    struct identity id;         /* E_beta's beta, folded */
    struct baked baked;
    struct texture texture;
    struct pipeline full;       /* SpiD, when the model has a refiner */
    struct pipeline star;       /* SpiD*: without it */
    struct pipeline alone[BRANCH_COUNT];        /* each branch by itself */
    /* (S,S,3) each, the last frame's; rgb is coarse without a refiner. */
    float *rgb, *coarse;
};

/* Load the model; head (borrowed, as the model is) must be the one it was
 * trained with. */
int reenactor_init(struct reenactor *r, const struct model *m,
                   const struct head *head, struct error *err);
/* Free what it holds; zeroed then. */
void reenactor_release(struct reenactor *r);

/* Phase A: shape, motion and bake of a source frame, which holds its whole
 * picture of the model's size.  without: the paper's ablations (avatar.h). */
int reenactor_source(struct reenactor *r, const struct data_frame *f,
                     unsigned without, struct error *err);

/* Phase B's first half: the source's person with the motion in crop q of f.
 * st->verts is the caller's (V,3). */
int reenactor_motion(struct reenactor *r, struct driven *st,
                     const struct data_frame *f, struct square q,
                     struct error *err);
/* The crop that the landmarks of a posed head ask for, in a picture of `size`
 * pixels. */
struct square reenactor_follow(const struct reenactor *r,
                               const struct driven *st, size_t size);

/* Phase B's second half: rgb and coarse with that motion. */
int reenactor_draw(struct reenactor *r, const struct motion *m,
                   struct error *err);
/* One branch's picture (S,S,3) alone, valid until the next. */
int reenactor_draw_branch(const float **rgb, struct reenactor *r,
                          enum avatar_branch b, const struct motion *m,
                          struct error *err);

#endif
