/* A synthetic person made ready for the camera: the head model with beta
 * folded in, what is painted on it, mouth, shoulders, glasses and strands. */
#ifndef SPID_LAB_PEOPLE_ACTOR_H
#define SPID_LAB_PEOPLE_ACTOR_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/head/lbs.h"
#include "lib/lab/people/persona.h"

/* Values of the stream's `label` array. */
enum synth_label {
    LABEL_NONE, LABEL_SKIN, LABEL_LIP, LABEL_EYE, LABEL_BROW, LABEL_HAIR,
    LABEL_MOUTH, LABEL_TEETH, LABEL_CLOTH, LABEL_GLASSES, LABEL_NECK,
    LABEL_EAR, LABEL_NOSE, LABEL_BEARD, LABEL_LASH, LABEL_OCCLUDER
};

enum material {
    MATERIAL_SKIN, MATERIAL_EYE, MATERIAL_TEETH, MATERIAL_MOUTH,
    MATERIAL_CLOTH, MATERIAL_INNER, MATERIAL_COUNT
};

/* What moves a vertex that is not the head model's. */
enum anchor { ANCHOR_HEAD, ANCHOR_JAW, ANCHOR_BODY };

enum strand_kind { STRAND_HAIR, STRAND_BROW, STRAND_LASH, STRAND_BEARD,
                   STRAND_FRAME, STRAND_KINDS };

struct paint {
    float c[3];                   /* place on the neutral person */
    float k[PAINT_COUNT];
};

/* Strands of one kind share a number of points.  Points lie in the head's
 * neutral frame; a strand is carried rigidly by the head, or rides on a face
 * of the head (face >= 0), which turns and moves it with the skin. */
struct strand {
    uint32_t first;               /* point */
    uint16_t points;
    uint8_t kind;
    int32_t face;                 /* of the head, or -1 */
    float half, tip;              /* half width at the root, share at tip */
    float random;                 /* -1..1 */
    float loose;                  /* how far the tip stays with the body */
};

struct strand_point {
    float p[3], n[3];             /* neutral position, outward normal */
    float open;                   /* light that reaches it through the hair */
};

struct actor {
    struct persona look;
    const struct head *head;
    struct identity id;
    size_t nv, nf;                /* the head's first, then ours */
    float *neutral;               /* (nv,3) */
    struct paint *paint;          /* (nv) */
    int32_t *faces;               /* (nf,3) */
    uint8_t *material, *label;    /* (nf) */
    uint8_t *anchor;              /* (nv) enum anchor, ours only */
    float *neck;                  /* (V) 0 head .. 1 body */
    size_t bowl;                  /* first vertex of the mouth bowl */
    struct strand *strand;
    size_t nstrand, strand_room;
    struct strand_point *point;
    size_t npoint, point_room;
    float lmk[68][3];             /* neutral landmarks */
    float eye[2][3], eye_radius;
    float mouth[3];               /* centre of the inner lips */
    float neck_base[3], neck_radius[2];
    float skull[3], skull_radius[3];
    float root_area;              /* largest face of the scalp, doubled */
};

/* Make a ready for persona p.  The actor borrows head. */
int actor_init(struct actor *a, const struct head *head,
               const struct persona *p, struct error *err);
/* Free what it holds. */
void actor_release(struct actor *a);

/* ---- its parts, for actor.c ------------------------------------------- */

/* Room for nv more vertices and nf more faces; their first indices. */
int actor_grow(struct actor *a, size_t nv, size_t nf, size_t *v0, size_t *f0,
               struct error *err);
/* A strand of n points (to be filled); NULL when memory is short. */
struct strand_point *actor_strand(struct actor *a, enum strand_kind kind,
                                  int n, float half, float tip);

/* What the persona has on each vertex and face of the head: skin, lips,
 * hair. */
void paint_head(struct actor *a);
/* Hang the mouth bowl of verts (nv,3) on the lips of its first V vertices. */
void mouth_pose(float *verts, const struct actor *a);
/* Neck and shoulders, rings about an axis. */
int body_build(struct actor *a, struct error *err);
/* The bowl of the mouth, both rows of teeth and the tongue. */
int mouth_build(struct actor *a, struct error *err);
/* Strands of hair in the persona's cut. */
int hair_grow(struct actor *a, struct error *err);
/* Brows, lashes and beard. */
int face_hair_grow(struct actor *a, struct error *err);
/* The persona's glasses, or none. */
int glasses_build(struct actor *a, struct error *err);

#endif
