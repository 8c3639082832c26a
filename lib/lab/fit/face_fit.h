/* The head fitted to labelled landmarks: one identity for each person, a
 * camera, an expression and a gaze for each frame.
 *
 * In rounds, each step with the others held:
 *   pose        Gauss and Newton over all points, robust
 *   identity    ridge over a person's frames, their poses eliminated
 *   offsets     where the labels' points lie beside the scans' vertices that
 *               they mean: of everyone, and what is left of each person,
 *               from calm frames
 *   gaze, lids  from the irises and the lids' gap
 *   expression  least squares between bounds, with the labelled blendshapes
 *               as prior; gaps of the lips, width of the mouth and height of
 *               the brows count by themselves
 * Pixels are of the portrait window at FIT_SIZE a side. */
#ifndef SPID_LAB_FIT_FACE_FIT_H
#define SPID_LAB_FIT_FACE_FIT_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/arena.h"
#include "lib/base/error.h"
#include "lib/lab/fit/face_points.h"
#include "lib/lab/fit/labels.h"
#include "lib/base/crop.h"
#include "lib/head/motion.h"

#define FIT_SIZE 384.0

struct fit_frame {
    const struct label *label;
    struct square window;               /* in the picture */
    double at[LANDMARK_COUNT][2];       /* landmarks, window pixels */
    double R[9], t[3];                  /* camera */
    double w[ARKIT_COUNT];              /* expression; gaze is in it too */
    double prior[ARKIT_COUNT];          /* what the blendshapes say */
    double gaze[2][2];                  /* left, right: pitch, yaw, radians */
    double closed[2];                   /* lids, 0 to 1, by the labels alone */
    bool calm;                          /* among a person's calmest frames */
};

struct fit_person {
    size_t first, count;                /* frames */
    double beta[FACE_SHAPES];
    double own[LANDMARK_FACE][3];       /* offsets, beside everyone's */
    double iris[2][2];                  /* of left, right, head's x and y */
    struct face_own face;               /* beta folded in */
};

struct face_fit {
    const struct face_points *points;   /* borrowed */
    size_t count, people;
    struct fit_frame *frame;            /* (count) in the labels' order */
    struct fit_person *person;          /* (people) */
    double offset[LANDMARK_FACE][3];    /* of everyone, head units */
    struct arena memory;
};

/* Windows, priors and first cameras for sorted labels, which are borrowed. */
int face_fit_init(struct face_fit *f, const struct face_points *p,
                  const struct labels *l, struct error *err);
/* Free what it holds; zeroed then. */
void face_fit_release(struct face_fit *f);
/* One round of all steps. */
int face_fit_round(struct face_fit *f, struct error *err);
/* Mean distance of the skin's landmarks from the labels, window pixels. */
double face_fit_error(const struct face_fit *f);

/* Frame k's motion, exp (ARKIT_EXP); crop and landmarks are not set. */
void face_fit_motion(struct motion *m, const struct face_fit *f, size_t k);

/* ---- parts, for face_fit_round and the tests ----------------------------- */

/* x = the skin's landmarks of a frame, head frame: the posed points and their
 * offsets, which fade on a lid that closes. */
void fit_points(double x[LANDMARK_FACE][3], const struct face_fit *f,
                const struct fit_person *p, const struct fit_frame *frame);
/* uv (window pixels) of head point x; j (may be NULL) its derivative by x,
 * pose (may be NULL) by a small turn before t and by t. */
void fit_project(double uv[2], double j[2][3], double pose[2][6],
                 const struct fit_frame *frame, const double x[3]);

/* Gauss-Newton steps on rotation and translation of a frame, its expression
 * held. */
void fit_pose(const struct face_fit *f, const struct fit_person *p,
              struct fit_frame *frame, int steps);
/* Ridge regression of the person's shape over its frames: expressions are held,
 * poses are free. */
int fit_identity(struct face_fit *f, struct fit_person *p, struct error *err);
/* f->offset: where on the head each labelled point really lies, the same for
 * everybody, from what is left over in all frames. */
int fit_offsets(struct face_fit *f, struct error *err);
/* A frame's expression by bounded least squares with the labelled blendshapes
 * as prior, its pose held. */
int fit_expression(const struct face_fit *f, const struct fit_person *p,
                   struct fit_frame *frame, struct error *err);
/* Each person's place of the iris points beside the pupils, drawn towards
 * everybody's mean. */
void fit_iris(struct face_fit *f);
/* Both eyes of a frame towards its iris points. */
void fit_gaze(const struct fit_person *p, struct fit_frame *frame);
/* Blinks and wide eyes of a frame, from the gaps between its lid points. */
void fit_lids(const struct face_fit *f, const struct fit_person *p,
              struct fit_frame *frame);
/* The opening of a lid of points xy, (n,2), along `down`: mean of four gaps,
 * as a share of the eye's width. */
double fit_lid_gap(const double (*xy)[2], int side, const double down[2]);

#endif
