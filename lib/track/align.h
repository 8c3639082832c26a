/* Photometric alignment of a driven head.  E_m finds a head to about half a
 * pixel, and one-sided expressions bias its pose: the avatar would tremble and
 * sway.  The rigid parts of the head (skull, hairline, nose) are therefore
 * aligned with the picture of a keyframe, by Gauss-Newton steps on the pose's
 * six parameters and the light's gain and bias (Lucas and Kanade 1981; points
 * move with the head), with E_m's pose as the prior.  The expression is aligned
 * after that (align_face.h). */
#ifndef SPID_TRACK_ALIGN_H
#define SPID_TRACK_ALIGN_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/error.h"
#include "lib/base/crop.h"
#include "lib/head/lbs.h"
#include "lib/head/motion.h"
#include "lib/track/align_face.h"

#define ALIGN_KEYFRAMES 32

/* A frame with which later ones are aligned.  Where all are taken, a new one
 * replaces the one that has been nearest to no frame for longest. */
struct align_keyframe {
    float R[9], t[3];
    size_t room;
    float *visibility;               /* (5,room): points that it shows well, at
                                 * rest (3), their levels, their weights */
    float *face;                /* what it shows of the face (align_face_show),
                                 * or NULL */
    size_t used;                /* frame that it was nearest to last */
};

struct align {
    size_t count, room;         /* points; numbers of a plane of them */
    float *point, *normal;      /* (3,room) at rest, head units */
    float *steady;              /* (room) 0 to 1: keeps its form */
    double middle[3];           /* of the points: what the head turns about */
    struct align_keyframe key[ALIGN_KEYFRAMES];
    size_t keys;
    size_t frames;              /* that were aligned or became keyframes */
    size_t misses;              /* frames in a row that matched no keyframe */
    align_pixel *picture;       /* (ALIGN_SIDE,ALIGN_SIDE) of this frame */
    float *work;                /* for it, and for a keyframe's points */
    struct align_face face;
};

/* Choose the points of a head at rest; id is borrowed. */
int align_init(struct align *a, const struct identity *id, struct error *err);
/* Free what it holds; zeroed then. */
void align_release(struct align *a);
/* Forget the keyframes: another scene. */
void align_restart(struct align *a);

/* What of the crop lies in the picture, as fractions of its side. */
struct align_bounds {
    double left, top, right, bottom;
};

/* m->R, m->t, m->exp: E_m's pose and expression of the crop rgb (224,224,3),
 * square q of a portrait window of `size` pixels; replaced by the aligned
 * ones.  The first frame is a keyframe and stays as it is.  false: no keyframe
 * matched, and m is unchanged. */
bool align_step(struct align *a, struct motion *m, const float *rgb,
                struct square q, struct align_bounds in, double size);

#endif
