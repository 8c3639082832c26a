/* A whole model at work on frames with known truth: both encoders, the
 * branches, the renderer and the refiner of one model file, planned for
 * inference in float. */
#ifndef SPID_LAB_EVAL_REENACTOR_H
#define SPID_LAB_EVAL_REENACTOR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/avatar/avatar.h"
#include "lib/base/error.h"
#include "lib/lab/data/data.h"
#include "lib/head/lbs.h"
#include "lib/net/model.h"
#include "lib/net/motion_encoder.h"
#include "lib/net/refiner.h"
#include "lib/net/shape_encoder.h"
#include "lib/splat/types.h"
#include "lib/photo/texture.h"
#include "lib/track/tta.h"

/* What may be taken from the data instead of the encoders, to tell their share
 * of an error from the branches'. */
enum { REENACTOR_TRUE_SHAPE = 1, REENACTOR_TRUE_MOTION = 2 };
/* Add "shape" or "motion" to *bits; -1 and EX_USAGE for another word. */
int reenactor_parse_truth(unsigned *bits, const char *word,
                          struct error *err);

/* The head as a frame drives it. */
struct driven {
    float R[9], t[3], cam[12];  /* of the portrait window */
    struct head_motion motion;
    float *verts;               /* (V,3), the caller's */
};

struct reenactor {
    const struct head *head;
    struct avatar_config config;
    unsigned truth;             /* REENACTOR_TRUE_* */
    const float *beta;          /* the true shape (head.nshape) then */

    struct params ps;
    struct motion_encoder motion;
    struct shape_encoder shape;
    struct avatar avatar;
    struct refiner refiner;     /* when config.has_refiner */
    struct splat splat;
    struct splat alone[BRANCH_COUNT];   /* each branch by itself */
    struct shape_tta shape_tta;         /* as spid-shape and spid-motion */
    struct motion_tta motion_tta;
    bool has_alone;
    struct texture texture;     /* of the source */
    float source_cam[12];

    struct identity id;         /* of the source: E_beta's beta, folded */
    float out[MOTION_OUT];      /* E_m's last output */
    /* One block of floats, S = config.size: */
    float *crop;                /* (224,224,3) */
    float *features, *alpha;    /* (S,S,C), (S,S) as drawn */
    float *place, *photo;       /* (S,S,3), (S,S,5) of lib/photo */
    float *cover;               /* (S,S) alpha after the photograph joined */
    float *coarse;              /* (S,S,3) SpiD*: without the refiner */
    float *rgb;                 /* (S,S,3) SpiD */
    float *means;               /* (N,3) of a frame */
    float *verts, *rest;        /* (V,3) of the source, at rest */
    uint8_t *picture, *matte;   /* (S,S,3), (S,S): the source */
};

/* Load the model, which may be closed afterwards; head (borrowed) must be the
 * one it was trained with. */
int reenactor_init(struct reenactor *r, const struct model *m,
                   const struct head *head, struct error *err);
/* Free what it holds; zeroed then. */
void reenactor_release(struct reenactor *r);

/* Phase A: shape, motion and bake of a source frame, which holds its whole
 * picture of config.size.  without: the paper's ablations (avatar.h). */
int reenactor_source(struct reenactor *r, const struct data_frame *f,
                     unsigned without, struct error *err);

/* Phase B's first half: the source's person with the motion in crop q of f.
 * st->verts is the caller's (V,3); st->motion.exp points into r->out. */
int reenactor_motion(struct reenactor *r, struct driven *st,
                     const struct data_frame *f, struct square q,
                     struct error *err);
/* The crop that the landmarks of a posed head ask for, in a picture of `size`
 * pixels. */
struct square reenactor_follow(const struct reenactor *r,
                               const struct driven *st, size_t size);

/* Phase B's second half: features, alpha, coarse and rgb of driven vertices
 * (V,3) seen by cam. */
int reenactor_draw(struct reenactor *r, const float *verts,
                   const float cam[12], struct error *err);
/* One branch's picture (S,S,3) alone. */
int reenactor_draw_branch(struct reenactor *r, float *rgb, float *alpha,
                          enum avatar_branch b, const float *verts,
                          const float cam[12], struct error *err);

#endif
