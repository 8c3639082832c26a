/* L_aux and L_lmk of Section 3.3: how far a motion predicted by E_m is from
 * the true one, in head, camera and picture, with the gradient for the
 * encoder's 120 numbers. */
#ifndef SPID_LAB_TRAIN_MOTION_LOSS_H
#define SPID_LAB_TRAIN_MOTION_LOSS_H

#include <stdbool.h>

#include "lib/base/error.h"
#include "lib/head/lbs.h"
#include "lib/lab/data/data.h"
#include "lib/lab/train/expression_features.h"
#include "lib/net/motion_encoder.h"

/* Terms, in the order of the log.  |x| is Huber's function where
 * motion_weights.huber asks for it. */
enum motion_term {
    TERM_VERTEX,        /* mean |V_d - V_d*| per coordinate, head units */
    TERM_ROTATION,      /* mean |R - R*| per entry */
    TERM_TRANSLATION,   /* mean |t' - t'*| per coordinate, of the crop */
    TERM_EYE,           /* mean |theta_eye - theta_eye*| */
    TERM_LANDMARK,      /* 68 points, pixels of a 512 picture over 64: mean
                         * distance, or its square (square_landmarks) */
    TERM_EXP,           /* mean |psi - psi*| */
    TERM_JAW,           /* mean |theta_jaw - theta_jaw*| */
    TERM_LID,           /* mean |e_lid - e_lid*| */
    TERM_MESH,          /* all vertices, posed as they are and as they should
                         * be: mean distance in the picture, as landmarks */
    TERM_FEATURE,       /* mean |f - f*| of what an expression shows, see
                         * expression_features.h, millimetres */
    TERM_CHANGE,        /* what the two frames of a pair differ by, in the
                         * numbers of the terms rotation to lid and feature:
                         * sum of weight * mean |error - partner's error| */
    TERM_COUNT
};

extern const char *const motion_term_name[TERM_COUNT];

struct motion_weights {
    float term[TERM_COUNT];     /* paper: 100, 10, 5, 10, and 1 with squares */
    bool square_landmarks;
    float huber;                /* where squares end, in the unit of each term
                                 * but rotation, translation and eye; 0: the
                                 * plain distance everywhere */
};

/* A predicted motion put together: what drives the avatar. */
struct motion_state {
    float R[9], t[3], cam[12];  /* of the portrait window */
    struct head_motion motion;  /* exp points into out */
    float *verts;               /* (V,3), the caller's */
};

/* Turn the encoder's row out (120), seen through crop q of f, into a motion;
 * s->verts is posed. */
void motion_decode(struct motion_state *s, const float *out,
                   const struct data_frame *f, struct square q,
                   const struct identity *id);

/* dout (120) += gradients of verts (V,3, or NULL) and cam (3,4, or NULL). */
void motion_decode_backward(float *dout, const float *dverts,
                            const float *dcam, const struct motion_state *s,
                            const float *out, const struct data_frame *f,
                            struct square q, const struct identity *id);

/* Predicted minus true, of what the term change compares. */
struct motion_error {
    float rotation[9], code[MOTION_OUT];        /* E_m's numbers but rotation's */
    float feature[EXPRESSION_FEATURES];         /* millimetres */
};

struct motion_loss {
    const struct identity *id;  /* of this frame: the true shape */
    const struct motion_error *partner; /* the other frame's of its pair, held
                                         * fixed; NULL for a single frame */
    float *verts, *truth, *dverts;      /* (V,3) each, one block with */
    float *uv, *uv_truth;               /* (V,2) each */
};

/* For motions of head h (borrowed). */
int motion_loss_init(struct motion_loss *l, const struct head *h,
                     struct error *err);
/* Free what it holds; zeroed then. */
void motion_loss_release(struct motion_loss *l);

/* Errors of a prediction: what motion_loss wants as its partner's. */
void motion_error(struct motion_error *e, const float *out,
                  const struct data_frame *f, struct square q,
                  struct motion_loss *l);

/* Weighted terms into parts[TERM_COUNT] (added), their sum returned; dout
 * (120) += scale * gradient.  s receives the decoded motion. */
double motion_loss(float *dout, double *parts, struct motion_state *s,
                   const float *out, const struct data_frame *f,
                   struct square q, const struct motion_weights *w,
                   double scale, struct motion_loss *l);

#endif
