/* A person of the scans made ready for the camera: one mesh of face, body and
 * everything worn, at rest in the head's frame. */
#ifndef SPID_LAB_PEOPLE_SCAN_FIGURE_H
#define SPID_LAB_PEOPLE_SCAN_FIGURE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/lab/people/scan_person.h"

/* What a face of the figure is made of.  From STUFF_VEIL on it is drawn over
 * the rest, farthest first, with its transparency. */
enum stuff {
    STUFF_SKIN, STUFF_SCALP, STUFF_EYE_LEFT, STUFF_EYE_RIGHT, STUFF_TEETH,
    STUFF_GUM, STUFF_SOCKET, STUFF_BODY, STUFF_CLOTH, STUFF_HAT, STUFF_FRAME,
    STUFF_METAL, STUFF_HAND,
    STUFF_VEIL, STUFF_BROW = STUFF_VEIL, STUFF_FUR, STUFF_LASH, STUFF_TEAR,
    STUFF_HAIR, STUFF_GLASS, STUFFS
};

/* What carries a corner: the scans' own vertex; the skin under it, with its
 * expressions; the head as a whole; the shoulders; the camera's frame. */
enum ride { RIDE_FACE, RIDE_SKIN, RIDE_HEAD, RIDE_BODY, RIDE_FREE };

struct figure_part {            /* a run of corners and faces */
    size_t c0, c1, f0, f1;
    enum stuff stuff;
    enum ride ride;
    const struct piece *piece;
    float tint[3];              /* times the picture over its mean */
    bool own;                   /* the picture's own colours */
    uint8_t label;
};

#define FIGURE_PARTS 24

struct figure {
    struct arena memory;        /* of what does not grow */
    struct scan_person look;
    const struct scan_assets *assets;
    struct light light;
    float exposure;             /* that shows the face well lit */
    float *rest;                /* (FACE_VERTICES,3) the neutral person */
    size_t nc, nf, nveil;       /* veils are the last nveil faces */
    float *place;               /* (nc,3) at rest, head frame */
    float *normal;              /* (nc,3) at rest */
    float *uv;                  /* (nc,2) */
    float *moment;              /* (nc,10) of the sky each corner sees */
    float *neck;                /* (nc) 0 goes with the head, 1 the body */
    float *extra;               /* (nc) layer of fur, or the like */
    int32_t *bind;              /* (nc,4) */
    float *weight;              /* (nc,4) */
    int32_t *faces;             /* (nf,3) */
    uint8_t *part;              /* (nf) index of figure_part */
    uint8_t *stuff;             /* (nf) */
    struct figure_part parts[FIGURE_PARTS];
    int nparts;
    uint8_t *skin;              /* texture (SKIN_SIZE,SKIN_SIZE,4) */
    uint8_t *brow;              /* (2,BROW_H,BROW_W) */
    float tone[3];              /* mean albedo of the skin, linear */
    float eye[2][3];
    float lip[3];               /* between the lips */
    float pivot[3];             /* the head turns about it */
};

/* All that p wears and is, as meshes; a is borrowed.  On failure what there is
 * of it stays to be freed. */
int figure_init(struct figure *f, const struct scan_assets *a,
                const struct scan_person *p, struct error *err);
/* Free what it holds; zeroed then. */
void figure_release(struct figure *f);

/* Add room for a part; its corners and faces are to be filled.  NULL and *err
 * when memory is short. */
struct figure_part *figure_grow(struct figure *f, size_t nc, size_t nf,
                                enum stuff stuff, enum ride ride,
                                uint8_t label, struct error *err);
/* What is modelled and not read (scan_made.c): frames of glasses, rings;
 * beards and lenses. */
int figure_add_solids(struct figure *f, struct error *err);
/* Beards, stubble on the scalp and lenses: what is seen through. */
int figure_add_veils(struct figure *f, struct error *err);
/* What stands in front of the person (scan_front.c). */
int figure_add_front(struct figure *f, struct error *err);

#endif
