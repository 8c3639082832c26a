/* Things worn: hair, brows, lashes, hats and clothes of MakeHuman's, laid on
 * the scans' neutral face, with their pictures. */
#ifndef SPID_LAB_PEOPLE_SCAN_PIECE_H
#define SPID_LAB_PEOPLE_SCAN_PIECE_H

#include <stddef.h>
#include <stdint.h>

#include "lib/lab/people/wavefront.h"
#include "lib/lab/people/scan_face.h"
#include "lib/lab/people/scan_near.h"

/* A picture to look colours up in; u to the right, v upwards. */
struct bitmap {
    int w, h;
    uint8_t *rgba;              /* (h,w,4) top row first; NULL: white */
};

/* Colour and alpha (0..1, as encoded) at (u, v), bilinear, clamped. */
void bitmap_sample(float rgba[4], const struct bitmap *t, float u, float v);

/* Read a picture of at least 2 x 2 pixels into memory. */
int bitmap_load(struct bitmap *t, const char *path, struct arena *memory,
                struct error *err);

/* A mesh on the neutral face.  bind: the vertices of the face that carry it
 * when the face is another person's. */
struct piece {
    char name[48];
    size_t nc, nf;
    float *place;               /* (nc,3) head units */
    float *uv;                  /* (nc,2) */
    int32_t *faces;             /* (nf,3) */
    int32_t *origin;            /* (nc) vertex that the corner was */
    uint8_t *hidden;            /* (vertices of the body) covered, or NULL */
    int32_t *bind;              /* (nc,4) vertices of the scans */
    float *weight;              /* (nc,4) */
    uint64_t *seen;             /* (nc) directions it is seen from */
    uint64_t *shade;            /* (FACE_VERTICES) directions it shuts off */
    struct bitmap picture;
    float mean[3];              /* of the picture, by alpha, linear */
};

/* MakeHuman's body laid on the scans' neutral face: below the chin it keeps
 * its own shape. */
struct body {
    struct wavefront mesh;      /* v: where MakeHuman has it, decimetres */
    float *place;               /* (nv,3) head units */
    size_t nbody;               /* vertices that are skin */
    struct near_tree near;      /* on the face and neck of the scans */
};

/* Read DIR/base.obj into memory and lay it on the face. */
int body_load(struct body *b, const struct scan_face *f, const char *dir,
              struct arena *memory, struct error *err);

/* Read DIR/NAME.mhclo with DIR/NAME.obj and DIR/PICTURE (NULL: it has none)
 * into memory.  above: only faces whose corners all lie higher (head units).  -1
 * and *err naming the file. */
int piece_load(struct piece *p, const struct body *b, const char *dir,
               const char *name, const char *picture, float above,
               struct arena *memory, struct error *err);
/* The same from arrays of ours (nv,3), (nf,3): skin of the body, a cap. */
int piece_make(struct piece *p, const struct body *b, const float *place,
               size_t nv, const int32_t *faces, size_t nf, float above,
               struct arena *memory, struct error *err);

/* The body's left hand with its forearm (scan_front.c): x across, y along the
 * fingers, z out of the palm, the wrist at the origin. */
int hand_make(struct piece *p, const struct body *b, struct arena *memory,
              struct error *err);

#endif
