/* The scans' face: ICT-FaceKit's mesh, identities and expressions, and where
 * they lie in our world.
 *
 * ICT-FaceKit measures in centimetres, x to the subject's left, y up, z out of
 * the face, as we do; so the way from there is a scale and a shift, no turn:
 *     metres      = 0.01 cm + SCAN_SHIFT        (a head file's v_template)
 *     head units  = 5 metres = 0.05 cm + 5 SCAN_SHIFT
 * A head registered to the
 * scans has their identity weights as its shape coefficients 0 to 99 and their
 * expression weights as motion: lib/head/arkit.h. */
#ifndef SPID_LAB_HEAD_SCAN_H
#define SPID_LAB_HEAD_SCAN_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/arena.h"
#include "formats/safetensors.h"

#define SCAN_IDENTITIES 100
#define SCAN_SCALE 0.01                     /* metres in a centimetre */
#define SCAN_SHIFT_X 0.0                    /* metres */
#define SCAN_SHIFT_Y -0.011
#define SCAN_SHIFT_Z -0.013

enum {
    SCAN_VERTS = 26719, SCAN_QUADS = 26384, SCAN_EXPRESSIONS = 57,
    SCAN_FACE = 9409,           /* vertices of the face, the first */
    SCAN_SKIN = 11248,          /* and of head and neck behind them */
    SCAN_TEETH = 17039, SCAN_TEETH_END = 21451,
    SCAN_EYE_LEFT = 21451,      /* sclera first, iris from SCAN_IRIS_LEFT */
    SCAN_IRIS_LEFT = 22221, SCAN_EYE_RIGHT = 23021, SCAN_EYE_END = 24591,
    SCAN_ORBIT_END = 14062,     /* eye sockets end, gums begin */
    SCAN_LASHES = 25351,        /* to the end */
    SCAN_LANDMARKS = 68
};

/* Lengths in metres in our world, shapes as differences in metres. */
struct scan {
    struct arena memory;        /* of all its arrays */
    float *neutral;             /* (SCAN_VERTS,3) */
    float *identity;            /* (100,SCAN_VERTS,3) one deviation each */
    float *expression;          /* (53,SCAN_VERTS,3) lib/head/arkit.h's order */
    int32_t *quads;             /* (SCAN_QUADS,4) triangles repeat the last */
    size_t nf;
    int32_t *f;                 /* (nf,3) triangles of the skin */
};

/* Centre of an eyeball, metres in our world: of the sphere through the sclera
 * about the cornea. */
void scan_eye(double centre[3], int right);
/* The direction in which it looks at rest, through the cornea's apex. */
void scan_eye_axis(double axis[3], int right);
/* How an eyeball has moved from the neutral face's to that of `face`, both
 * (SCAN_VERTS,3) in units of which a metre has `unit`: a shift of its centre
 * and a share by which it has grown, by least squares over its sclera. */
void scan_eye_motion(double shift[3], double *grow, const float *neutral,
                     const float *face, double unit, int right);
#define SCAN_EYE_RADIUS 0.0145  /* metres; just clear of the lids' margins */

extern const int32_t scan_landmarks[SCAN_LANDMARKS];    /* vertices */

/* Read ict.safetensors as its README describes it.  -1 and *err naming the
 * tensor that is missing, misshapen or not finite, or the name that is not
 * there; *s is then released. */
int scan_load(struct scan *s, const char *path, struct error *err);
void scan_release(struct scan *s);          /* a zeroed scan is allowed */

/* neutral, identity, expression and quads alone, still in the file's
 * centimetres. */
int scan_read(struct scan *s, const struct safetensors *st, struct error *err);

#endif
