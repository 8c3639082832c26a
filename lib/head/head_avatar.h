/* The template avatar of a head: what a person has that a photograph may not
 * show, and how skin moves, as numbers per point of the mesh and per Gaussian
 * of the mouth.  It is a part of the head's file (tensors "avatar.NAME", 16-bit
 * floats but for indices, lengths in head units unless it says mm), and belongs
 * to the head's mean person; `spid-head` computes the points again
 * (lib/lab/head/avatar_make.h).  A photograph overrides what it shows; what is
 * left is lit by the photograph's white (lib/avatar/white_point.h).
 *
 * A point is a vertex or, behind those, the middle of an edge, in the order of
 * lib/base/densify.h.  A mouth Gaussian is a cell of a square grid: rows of the
 * upper teeth from their edges up, then the lower teeth from their edges down,
 * then what is behind from the palate down.  The mouth is data: crowns as wide
 * and high as adults' teeth roughly are, on an arch, palate and tongue that were
 * measured on the mean of the ICT scans, enamel as 20 smiling people of the
 * London set have it.  To change the colour of teeth, change mouth_color of rows
 * whose mouth_layer is 0 or 1. */
#ifndef SPID_HEAD_HEAD_AVATAR_H
#define SPID_HEAD_HEAD_AVATAR_H

#include <stddef.h>

#include "formats/safetensors.h"
#include "lib/base/error.h"
#include "lib/base/neck_blend.h"

#define HEAD_STYLES 6   /* of hair, and of cloth */

enum mouth_layer { MOUTH_UPPER, MOUTH_LOWER, MOUTH_BACK };

struct head_avatar {
    size_t V, points;       /* D: vertices and midpoints */
    size_t mouth;           /* side T of the mouth's grid */

    /* Points (D). */
    float *neck;            /* share of the shoulders' motion, 0 to 1 */
    float *lining;          /* 1 inside the mouth, behind the lips */
    float *lid;             /* 1 on upper lids, which come down over the eyes
                             * when those close */
    float *fold;            /* the same but for their margin: skin that comes
                             * out of the crease */
    float *reach;           /* of gaussian_seen: of lids negative, since the
                             * photograph shows their skin folded once they
                             * come down; 0 elsewhere */
    float *seam;            /* 1 where the lips meet, 0 a few mm from there */
    float *crease;          /* the same, and 1 at the mouth's corners, from
                             * which the lips' line goes on */
    float *lips;            /* 1 on the lips, 0 beyond them */
    float *stretch;         /* neighbours' distance there on closed lids, at a
                             * dropped jaw and under raised brows over that at
                             * rest, at least 1 */
    size_t *mirror;         /* the point across the face; in the file an i32 */
    float *side;            /* 1 the subject's left, -1 right */
    float *lid_skin;        /* how far a closed lid there has the colour of the
                             * skin about the eye, not of the crease */
    float *eyeball;         /* (D,3) shares of pupil, iris and white; all 0:
                             * no eyeball */
    float *about_eye;       /* (V,2) how far skin is about the left eye, and
                             * the right one */
    float *eye_color;       /* (3,3) sRGB of pupil, iris and white under white
                             * light */
    float *moving;          /* (V) 1 and more where expressions, jaw, lids or
                             * gaze move the skin, 0 on the skull */
    float *hair;            /* (V,HEAD_STYLES) chance of hair in each of these
                             * ways to wear it, and */
    float *hair_share;      /* (HEAD_STYLES) of people who do */
    float *relief;          /* (V,HEAD_STYLES) how far it stands off the mesh */
    float *cloth;           /* (V,HEAD_STYLES) chance of cloth where no hair is */
    float *cloth_share;     /* (HEAD_STYLES); all five: examples/materials.py */
    float *neck_blend;      /* (5) pivot, top and bottom of struct neck_blend */

    /* The mouth (T,T), from the inner lips' centroid of a face at rest. */
    float *mouth_place;     /* (T,T,3) mm: x to the left, y up, z to the front */
    float *mouth_size;      /* (T,T,3) mm: standard deviations */
    float *mouth_turn;      /* (T,T,4) rotation, w first */
    float *mouth_color;     /* (T,T,3) sRGB under white light */
    float *mouth_jaw;       /* share of the jaw's way */
    float *mouth_layer;     /* enum mouth_layer */

    float *block;           /* what the arrays are part of */
};

/* Memory for V vertices, D points and T x T mouth Gaussians.  EX_OSERR. */
int head_avatar_init(struct head_avatar *a, size_t V, size_t D, size_t T,
                     struct error *err);
/* Free what it holds; zeroed then. */
void head_avatar_release(struct head_avatar *a);

/* From a head's file of V vertices; all zero, mouth 0, where that has none.
 * EX_DATAERR naming what is damaged. */
int head_avatar_read(struct head_avatar *a, const struct safetensors *st,
                     size_t V, struct error *err);

/* The arrays by name, for whoever writes them: array i, or NULL behind the
 * last; *count its numbers, *width of them a row. */
const float *head_avatar_array(const struct head_avatar *a, size_t i,
                               const char **name, size_t *count,
                               size_t *width);

/* The neck blend of the mean head. */
struct neck_blend head_avatar_neck(const struct head_avatar *a);

#endif
