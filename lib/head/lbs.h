/* Posing the head: Eq. M and Eq. V_d.
 *   V_d = W(T + B_S(beta) + B_E(psi) + B_P(theta), J, theta, weights)
 *         + lid_L Delta_L + lid_R Delta_R
 * beta is folded into the template once per identity; a frame pays for the
 * expression directions whose coefficient is not 0, the pose correctives of
 * the joints that turn, and the skinning.  Joints are regressed from the
 * shaped template with the expression added, as the public FLAME code does. */
#ifndef SPID_HEAD_LBS_H
#define SPID_HEAD_LBS_H

#include <stddef.h>

#include "lib/base/error.h"
#include "lib/head/head.h"

/* A head with beta folded in. */
struct identity {
    const struct head *head;
    float *shaped;                  /* (blocks, 96) template + B_S(beta) */
    const float *lids;              /* (blocks, 2, 96) this identity's */
    float *own_lids;                /* where they are not the head's, or NULL */
    double joints[HEAD_JOINTS * 3]; /* regressed from it */
};

/* One frame's parameters.  exp may be NULL (no expression). */
struct head_motion {
    const float *exp;               /* (nexp) psi */
    float global[3], neck[3];       /* axis-angle; 0 in the pipeline, where
                                     * the camera carries them */
    float jaw[3];                   /* axis-angle */
    float eye[6];                   /* left, right axis-angle */
    float lid[2];                   /* left, right; 0 open to 1 closed */
};

/* Gradients of a frame, added to; exp (nexp) and beta (nshape) may be NULL. */
struct head_motion_grad {
    float *exp, *beta;
    float global[3], neck[3], jaw[3], eye[6], lid[2];
};

/* Fold beta (nbeta <= nshape, the rest 0) into the template.  -1 when nbeta is
 * too large or memory is short.  The identity borrows h. */
int head_fold(struct identity *id, const struct head *h, const float *beta,
              size_t nbeta, struct error *err);
/* Add offset (V,3), head units, to the vertices at rest; the joints stay. */
void identity_move(struct identity *id, const float *offset);
/* Free what it holds; zeroed then. */
void identity_release(struct identity *id);

/* verts (V,3) out: driven vertices, head units.  One core, no allocation;
 * may be called from several threads.  Within 1e-6 of head_pose_d relative
 * to the head's size: tests/unit/head_lbs.c. */
void head_pose(float *verts, const struct identity *id,
               const struct head_motion *m);
/* verts (V,3) out: the identity at rest, no pose and no expression. */
void identity_rest(float *verts, const struct identity *id);
/* Also the posed joints (5,3). */
void head_pose_joints(float *joints, const struct identity *id,
                      const struct head_motion *m);

/* g += gradient of dverts (V,3) and, when not NULL, djoints (5,3) with respect
 * to every field of m (exp, rotations, lids) and to beta. */
void head_pose_backward(struct head_motion_grad *g, const float *dverts,
                        const float *djoints, const struct identity *id,
                        const struct head_motion *m);

/* ---- double-precision reference --------------------------------------- */

/* Parameters in double: beta (nshape), exp (nexp), pose (15) = root, neck,
 * jaw, left eye, right eye; lid (2). */
struct head_motion_d {
    const double *beta, *exp;
    double pose[3 * HEAD_JOINTS];
    double lid[2];
};
/* m's numbers, its expression in exp (nexp); beta is the caller's. */
struct head_motion_d head_motion_widen(double *exp, const struct head_motion *m,
                                       size_t nexp);
/* verts (V,3) and joints (5,3, or NULL). */
void head_pose_d(double *verts, double *joints, const struct head *h,
                 const struct head_motion_d *m);

#endif
