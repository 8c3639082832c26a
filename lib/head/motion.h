/* MOTN records: the motion Theta_d of one frame. */
#ifndef SPID_HEAD_MOTION_H
#define SPID_HEAD_MOTION_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/head/head.h"
#include "lib/head/lbs.h"
#include "lib/stream/stream.h"

struct motion {
    struct head_motion pose;        /* pose.exp points at exp */
    float exp[HEAD_MAX_EXP];        /* psi */
    float R[9], t[3];               /* Eq. T_d: the camera */
    float crop[3];                  /* face crop, portrait-window pixels */
    float light[3];                 /* l on the face, camera frame (GAUS has it
                                     * in the head's), */
    bool lit;                       /* if it is known */
};

/* Fill m from a MOTN record of a head with nexp expression directions (0: they
 * are not read).  -1 and *err naming the array when one is missing, of another
 * size or not finite. */
int motion_read(struct motion *m, const struct record *rec, size_t nexp,
                struct error *err);
/* How many expression coefficients the record has. */
size_t motion_expressions(const struct record *rec);
/* The record's landmarks (68,2), pixels of the portrait window.  1; 0: it has
 * none; -1 when they are of another shape. */
int motion_read_landmarks(float lmk[HEAD_LANDMARKS][2],
                          const struct record *rec, struct error *err);
/* The arrays of m, MOTION_ARRAYS of them, the crop's last; views of m.  A
 * further picture of a person has all but that one in its SRCI record, too. */
#define MOTION_ARRAYS 7
void motion_arrays(struct array *a, const struct motion *m, size_t nexp);
/* m's light; where it is known, motion_write adds it. */
struct array motion_light(const struct motion *m);
/* Write m as a MOTN record, others (may be NULL) appended. */
int motion_write(struct stream_writer *w, uint64_t frame, double time,
                 const struct motion *m, size_t nexp,
                 const struct array *others, int nothers, struct error *err);

/* What a MOTN record may have besides, for motion_write's others; the data are
 * the caller's.  lmk (68,2): pixels of the portrait window. */
struct array motion_landmarks(const float *lmk);
/* points (n,2): pixels of the portrait window. */
struct array motion_points(const float *points, size_t n);
/* confidence (1): how sure the encoder is, 0 to 1. */
struct array motion_confidence(const float *confidence);
/* What an identity's MOTN has: face (nexp + 5) is expression, jaw and lids of
 * its person at rest. */
struct array motion_calm(const float *face, size_t nexp);
/* m's face from the record's, where it has one: 1, 0, -1 and *err. */
int motion_read_calm(struct motion *m, const struct record *rec, size_t nexp,
                     struct error *err);
/* face (nexp + 5) of m, as in the array. */
void motion_face(float *face, const struct motion *m, size_t nexp);
/* No face: the last motion is held. */
struct array motion_lost(void);

/* cam (3,4) = [R|t]. */
void motion_camera(float cam[12], const struct motion *m);

#endif
