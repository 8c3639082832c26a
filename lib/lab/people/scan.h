/* People from an assets folder: the scans' faces under real light, dressed
 * and combed, with skin statistics of photographs.  What is read once. */
#ifndef SPID_LAB_PEOPLE_SCAN_H
#define SPID_LAB_PEOPLE_SCAN_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/head/head.h"
#include "lib/lab/people/scan_act.h"
#include "lib/lab/people/scan_face.h"
#include "lib/lab/people/scan_follow.h"
#include "lib/lab/people/scan_light.h"
#include "lib/lab/people/scan_piece.h"
#include "lib/lab/people/scan_register.h"
#include "lib/lab/people/scan_skin.h"
#include "lib/lab/people/traits.h"

/* What a pixel of a synthetic picture shows: values of the stream's `label`. */
enum synth_label {
    LABEL_NONE, LABEL_SKIN, LABEL_LIP, LABEL_EYE, LABEL_BROW, LABEL_HAIR,
    LABEL_MOUTH, LABEL_TEETH, LABEL_CLOTH, LABEL_GLASSES, LABEL_NECK,
    LABEL_EAR, LABEL_NOSE, LABEL_BEARD, LABEL_LASH, LABEL_OCCLUDER
};

#define SCAN_PIECES 24          /* of one kind at most */

struct scan_rack {              /* pieces of one kind */
    size_t n;
    struct piece piece[SCAN_PIECES];
};

struct scan_plain;              /* scan_plain.c */

struct scan_assets {
    struct arena memory;        /* of all that follows */
    struct scan_plain *plain;   /* of a plain figure, or NULL */
    struct scan_face face;
    struct follow_map follow;
    struct body body;
    struct piece torso;         /* the body's own skin below the chin */
    struct piece hand;          /* its left hand */
    struct scan_rack hair, hat, cloth;
    struct bitmap iris[SCAN_PIECES];
    size_t niris;
    struct light_map *light;
    size_t nlight;
    struct skin_model skin;
    struct act_model act;
    struct traits traits;       /* how people look and move */
    uint64_t *seen;             /* (FACE_VERTICES) directions each is seen
                                 * from, bald */
    uint8_t *label;             /* (FACE_VERTICES) enum synth_label */
    float *hairy;               /* (FACE_VERTICES) 0 bare .. 1 under hair */
    int32_t point[LANDMARK_FACE]; /* the face's corners that the labels'
                                     * landmarks mean */
};

/* Read everything under DIR (ict/, makehuman/, hdri/, photos/, labels/), with
 * light (NULL: each of hdri/) as the only panorama, and the file of traits (NULL:
 * the built-in ones).  head lends its regions.  NULL and
 * *err naming the file that is missing, cut, of another shape or holds numbers
 * that are none. */
struct scan_assets *scan_open(const char *dir, const char *light,
                              const char *traits, const struct head *head,
                              struct error *err);
/* The same from the head (borrowed) alone: one plain figure, of all identities
 * and skins, in made rooms.  NULL and *err when the head is not the built-in
 * one's kind. */
struct scan_assets *scan_plain_open(const char *traits, const struct head *h,
                                    struct error *err);
void scan_close(struct scan_assets *a);         /* NULL is allowed */

/* ---- parts of them -------------------------------------------------------- */

/* enum synth_label of a vertex of the head in a region. */
uint8_t scan_label_of(int32_t region);
/* A plain figure's x (FACE_VERTICES,3) from the head's posed verts (V,3); rest
 * (FACE_VERTICES,3): the person's at rest. */
void scan_plain_pose(float *x, const struct scan_plain *p, const float *rest,
                     const float *verts);
/* Where a place p of its neutral face lies on the texture square: eyes, at
 * height `eye`, and lips are where photographs have them. */
void plain_uv(float uv[2], const float *p, float eye);
/* Skin, irises, a shirt and rooms of a, whose face and labels are there. */
int plain_make_looks(struct scan_assets *a, struct error *err);

/* ---- directions of the sky, for visibility ------------------------------ */

#define SKY_DIRECTIONS 64

/* The k-th of SKY_DIRECTIONS even directions, head frame. */
void sky_direction(float d[3], int k);
/* Fill a->seen and every hair's and hat's seen and shade. */
int sky_measure(struct scan_assets *a, struct error *err);
/* Moments (harmonic2_moments) of the cosine about unit n over the directions
 * in mask. */
void sky_moments(float m[10], uint64_t mask, const float n[3]);

#endif
