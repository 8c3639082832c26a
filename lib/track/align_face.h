/* Photometric alignment of a driven face: where its pose is known, its
 * expression is laid over the keyframe, too.  E_m says which expression it is,
 * and how much of it less exactly, above all of a mouth drawn wide or narrow;
 * the skin shows that as movement.  Gauss-Newton steps on the expression's
 * numbers and on the light (Lucas and Kanade 1981, with the head's expression
 * directions as the model of how points move), held near E_m's expression and
 * to its opening of the mouth, whose inside is no skin.  Lids are sought with
 * it, the less the more E_m finds them shut: the skin that comes out of their
 * crease then is none that the keyframe shows. */
#ifndef SPID_TRACK_ALIGN_FACE_H
#define SPID_TRACK_ALIGN_FACE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/head/lbs.h"
#include "lib/record/motion.h"
#include "lib/track/align_kernel.h"

#define ALIGN_FACE_GAPS 3       /* places where the mouth's opening is held */
#define ALIGN_FACE_LID(side) (-1 - (side))  /* 0 left, 1 right; and the way
                                             * back */

struct align_face {
    const struct identity *id;
    size_t count, room;         /* points; numbers of a plane of them */
    int32_t *vertex;            /* (count) */
    size_t codes;               /* numbers that are sought; 0: the head says
                                 * too little, nothing is done */
    size_t unknowns;            /* with the light's, a multiple of 4 */
    int code[ALIGN_FACE_CODES]; /* which component of an expression each is,
                                 * or which lid (ALIGN_FACE_LID) */
    float spread[ALIGN_FACE_CODES]; /* of E_m about the truth */
    bool lid[ALIGN_FACE_CODES]; /* it moves lids more than all else */
    float *direction;           /* (codes,3,room) head units per spread */
    double gap[ALIGN_FACE_GAPS][ALIGN_FACE_CODES];  /* of the lips, in spreads
                                                     * per spread */
    float *verts, *normal;      /* (V,3) of the posed head */
    float *point, *facing;      /* (3,room) the points of it, their normals */
};

/* Choose points and directions of a head; id is borrowed. */
int align_face_init(struct align_face *f, const struct identity *id,
                    struct error *err);
/* Free what it holds; zeroed then. */
void align_face_release(struct align_face *f);

/* shown (2,room): levels of m's points in the picture, and what each counts
 * when other frames are laid over this one. */
void align_face_show(float *shown, struct align_face *f,
                     const struct motion *m, const align_pixel *picture,
                     const struct align_look *look);
/* m->exp, m->pose.lid: E_m's in, the aligned ones out; the rest of m's pose and
 * `look` are aligned already, and the light is about gain and bias.  shown: a
 * keyframe's. */
void align_face_fit(struct align_face *f, struct motion *m,
                    const float *shown, const align_pixel *picture,
                    const struct align_look *look, float gain, float bias);

#endif
