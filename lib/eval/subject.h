/* A whole model for evaluation: the encoders, the branches, the renderer and
 * the refiner of one model file, planned for inference. */
#ifndef SPID_EVAL_SUBJECT_H
#define SPID_EVAL_SUBJECT_H

#include <stddef.h>
#include <stdint.h>

#include "lib/avatar/avatar.h"
#include "lib/base/error.h"
#include "lib/head/lbs.h"
#include "lib/net/motion_encoder.h"
#include "lib/net/shape_encoder.h"
#include "lib/track/looks.h"
#include "lib/train/data.h"
#include "lib/train/motion_loss.h"
#include "lib/train/avatar_system.h"

struct subject {
    const struct head *head;
    struct params ps;
    struct avatar_config config;
    struct avatar_system tr;    /* avatar, splat, refiner at full size */
    struct motion_encoder motion;
    struct shape_encoder shape;
    struct looks looks;         /* both look as spid-shape and spid-motion */
    struct motion_looks motion_looks;
    float *crop;                /* (224,224,3) */
    float out[MOTION_OUT];      /* of the last subject_look */
    struct identity id;         /* of the source: E_beta's beta, folded */
    unsigned truth;             /* SUBJECT_TRUE_*: taken from the data instead
                                 * of the encoders, to tell their share of an
                                 * error from the branches' */
    const float *beta;          /* the true shape (head.nshape) then */
    struct square window;       /* where the face is looked for next */
    struct splat alone[BRANCH_COUNT];   /* each branch by itself */
    int has_alone;
};

enum { SUBJECT_TRUE_SHAPE = 1, SUBJECT_TRUE_MOTION = 2 };

/* Load the model file; head must be the one it was trained with. */
int subject_init(struct subject *s, const char *path, const struct head *h,
                 struct error *err);
void subject_release(struct subject *s);

/* beta of the face in crop q of f, folded into id (released first). */
int subject_shape(struct subject *s, struct identity *id,
                  const struct data_frame *f, struct square q,
                  struct error *err);

/* Phase B's first half: the motion in crop q of f of identity id.  st->verts
 * is the caller's (V,3); st->motion.exp points into s->out. */
int subject_look(struct subject *s, struct motion_state *st,
                 const struct identity *id, const struct data_frame *f,
                 struct square q, struct error *err);

/* The crop that the landmarks of a posed head ask for. */
struct square subject_follow(const struct subject *s,
                             const struct motion_state *st, size_t size);

/* Phase A: shape, motion and bake of a source frame.  without: the paper's
 * ablations (avatar.h). */
int subject_source(struct subject *s, const struct data_frame *f,
                   unsigned without, struct error *err);

/* One branch's picture (S,S,3) of the frame last driven with verts, cam. */
int subject_branch(struct subject *s, float *rgb, float *alpha,
                   enum avatar_branch b, const float *verts,
                   const float cam[12], struct error *err);

#endif
