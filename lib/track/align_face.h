/* Photometric alignment of a driven face: once its pose is aligned (align.h),
 * so is its expression.  E_m tells which expression it is better than how
 * strong; the movement of the skin tells that.  Gauss-Newton steps on the
 * expression's components and on the light (Lucas and Kanade 1981; points move
 * in the head's expression directions), with E_m's expression as the prior.
 * Its opening and width of the mouth are priors, too, since lips, which roll
 * and part, are not tracked. */
#ifndef SPID_TRACK_ALIGN_FACE_H
#define SPID_TRACK_ALIGN_FACE_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/head/part.h"
#include "lib/head/motion.h"
#include "lib/track/align_kernel.h"

#define ALIGN_FACE_MEASURES 4   /* of the mouth: opening at 3 places, width */
/* The code of a lid (side 0 left, 1 right), and the side of a code. */
#define ALIGN_FACE_LID(side) (-1 - (side))

struct align_face {
    const struct identity *id;
    size_t count, room;         /* points; numbers of a plane of them */
    int32_t *vertex;            /* (count) */
    size_t codes;               /* parameters of the face; 0: the head has too
                                 * few directions, nothing is done */
    size_t unknowns;            /* with the light's, a multiple of 4 */
    int code[ALIGN_FACE_CODES]; /* each parameter's component of the expression
                                 * or, negative, lid (ALIGN_FACE_LID) */
    float spread[ALIGN_FACE_CODES]; /* standard deviation of E_m's error */
    float *direction;           /* (codes,3,room) head units per spread */
    double measure[ALIGN_FACE_MEASURES][ALIGN_FACE_CODES];  /* of the mouth, in
                                 * its spreads per spread */
    struct head_part part;      /* the points alone */
    float *verts, *normal;      /* (V,3) of the whole head, for a keyframe */
    float *point, *facing;      /* (3,room) the points of it, their normals */
};

/* Choose points and directions of a head; id is borrowed. */
int align_face_init(struct align_face *f, const struct identity *id,
                    struct error *err);
/* Free what it holds; zeroed then. */
void align_face_release(struct align_face *f);

/* shown (2,room): levels of m's points in the picture, and each one's weight
 * when other frames are aligned with this one. */
void align_face_show(float *shown, struct align_face *f,
                     const struct motion *m, const align_pixel *picture,
                     const struct align_camera *camera);
/* m->exp, m->pose.lid: E_m's in, the aligned ones out; the rest of m's pose and
 * `camera` are aligned already, and the light is about gain and bias.  shown: a
 * keyframe's. */
void align_face_fit(struct align_face *f, struct motion *m,
                    const float *shown, const align_pixel *picture,
                    const struct align_camera *camera, float gain, float bias);

#endif
