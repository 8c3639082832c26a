/* The scans' full geometry (ICT-FaceKit): face, lids, lashes, eyes, teeth,
 * gums and tongue with their identities and expressions, in head units. */
#ifndef SPID_LAB_PEOPLE_SCAN_FACE_H
#define SPID_LAB_PEOPLE_SCAN_FACE_H

#include <stddef.h>
#include <stdint.h>

#include "lib/lab/head/scan.h"
#include "lib/lab/head/scan_lids.h"

/* Vertices of the scans, by what they are (README of the data). */
enum {
    FACE_SKIN_END = 9409, FACE_NECK_END = 11248, FACE_SOCKET_END = 13294,
    FACE_ORBIT_END = 14062, FACE_GUMS_END = 17039, FACE_TEETH_END = 21451,
    FACE_EYE_LEFT_END = 23021, FACE_EYE_RIGHT_END = 24591,
    FACE_TEAR_END = 24999, FACE_BLEND_END = 25047, FACE_SHADE_END = 25351,
    FACE_VERTICES = 26719
};
#define FACE_LANDMARKS 68

/* Materials of the scans, in the file's order. */
enum face_part {
    PART_BACK, PART_BLEND, PART_LASH, PART_SHADE, PART_SKIN, PART_GUM,
    PART_IRIS_LEFT, PART_IRIS_RIGHT, PART_TEAR, PART_SCLERA_LEFT,
    PART_SCLERA_RIGHT, PART_TEETH, PART_COUNT
};

/* Vertices are split where texture coordinates part: corner c of the mesh is
 * vertex source[c] of the scans at uv (u, v) of its tile, v upwards. */
struct scan_face {
    size_t nc, nf;
    int32_t *source;            /* (nc) */
    float *uv;                  /* (nc,2) */
    int32_t *faces;             /* (nf,3) corners */
    int32_t *raw;               /* (nf,3) vertices of the scans */
    uint8_t *part;              /* (nf) enum face_part */
    float *neutral;             /* (FACE_VERTICES,3) head units */
    float *identity;            /* (SCAN_IDENTITIES,FACE_VERTICES,3) */
    float *expression;          /* (ARKIT_COUNT,FACE_VERTICES,3) head units */
    float eye[2][3];            /* centres of the eyeballs, left first */
    float axis[2][3];           /* and where they look, unit */
    struct scan_lids lids;      /* what makes them close */
    int32_t landmark[FACE_LANDMARKS];   /* vertices of the 68 points */
};

/* Its eye and axis, of ICT-FaceKit's mean face. */
void scan_face_find_eyes(struct scan_face *f);

/* Head units in a unit of the scans. */
#define FACE_UNIT ((float)(5 * SCAN_SCALE))

/* Read an ict.safetensors into memory.  -1 and *err naming file and array when
 * one is missing, cut, of another shape or not finite. */
int scan_face_load(struct scan_face *f, const char *path, struct arena *memory,
                   struct error *err);

/* out (FACE_VERTICES,3): the neutral face of identity beta (n standard
 * deviations, n at most SCAN_IDENTITIES). */
void scan_face_fold(float *out, const struct scan_face *f, const float *beta,
                    size_t n);
/* x (FACE_VERTICES,3) += expression of weights w (ARKIT_COUNT) of the person
 * whose neutral face is `rest`; gazes move lids alone. */
void scan_face_express(float *x, const struct scan_face *f, const float *rest,
                       const float *w);

#endif
