/* Shading of visible samples, SHADE_N at a time: what was gathered from the
 * surfaces goes in, linear light comes out.  Camera space: x right, y down,
 * z forward, the eye at the origin. */
#ifndef SPID_LAB_PEOPLE_SHADE_H
#define SPID_LAB_PEOPLE_SHADE_H

#include "lib/lab/people/sun.h"

#define SHADE_N 64
#define SHADE_LIGHTS 3

/* What a vertex carries for its material, each 0..1 (struct paint). */
enum paint_kind {
    PAINT_RED,      /* blood under the skin: cheeks, nose, ears */
    PAINT_LIP,
    PAINT_BEARD,    /* where a beard grows */
    PAINT_HAIR,     /* scalp under hair */
    PAINT_DARK,     /* eye sockets, folds */
    PAINT_OIL,      /* shine */
    PAINT_SHUT,     /* ambient light kept out, for the whole person */
    PAINT_BROW,
    PAINT_COUNT
};

/* Inputs and outputs of one block; unused lanes hold any finite numbers. */
struct shade_block {
    float p[3][SHADE_N];              /* camera position */
    float n[3][SHADE_N];              /* normal, any length */
    float c[3][SHADE_N];              /* place on the neutral person */
    float k[PAINT_COUNT][SHADE_N];
    float ao[SHADE_N];                /* screen-space ambient visibility */
    float rgb[3][SHADE_N];            /* out */
};

struct shade_light {
    float dir[3];                     /* unit, towards the light */
    float rgb[3];
};

/* An exponential shadow map seen from light 0: map holds the blurred mean of
 * exp(sharp * height) with height along w. */
struct shade_shadow {
    const float *map;
    int n;
    struct sun sun;
    float sharp;
};

struct shade_env {
    struct shade_light light[SHADE_LIGHTS];
    float cube[6][3];                 /* ambient from -x +x -y +y -z +z */
    struct shade_shadow shadow;
};

struct shade_skin {
    float base[3], lip[3], hair[3], brow[3];
    float shift[3];                   /* where in the noise this person is */
    float blotch, freckle, pores, oil, stubble, gloss, wrinkle;
    float shaved;                     /* scalp colour: 0 hair, 1 skin */
};

struct shade_eye {
    float centre[2][3];               /* of the eyeballs, neutral, left first */
    float radius;
    float iris[3], ring[3];
    float iris_radius, pupil;         /* over the eyeball's radius */
    float white[3], vein;
    float shift[3];
};

enum cloth_weave { CLOTH_PLAIN, CLOTH_KNIT, CLOTH_STRIPES, CLOTH_PLAID,
                   CLOTH_WEAVES };

/* Also used for teeth, tongue and the inside of the mouth. */
struct shade_cloth {
    enum cloth_weave weave;
    float base[3], second[3];
    float scale, bump, gloss, wet, grain;
    float shift[3];
};

struct shade_strand {
    float base[3];
    float spread;                     /* brightness from strand to strand */
    float gloss, tint;                /* highlights: white, hair-coloured */
    float soft;                       /* light that passes through */
};

typedef void shade_skin_fn(struct shade_block *b, const struct shade_env *env,
                           const struct shade_skin *s);
typedef void shade_eye_fn(struct shade_block *b, const struct shade_env *env,
                          const struct shade_eye *s);
typedef void shade_cloth_fn(struct shade_block *b, const struct shade_env *env,
                            const struct shade_cloth *s);
/* For strands n is the outward normal of the hair as a whole, c the tangent,
 * k[0] a random number of the strand, k[1] the place across (-1..1), k[2] the
 * visibility of the point inside the hair. */
typedef void shade_strand_fn(struct shade_block *b,
                             const struct shade_env *env,
                             const struct shade_strand *s);

/* The shaders of the best instruction set; every version gives the same bits
 * (no contraction, no reassociation). */
struct shade_kernels {
    shade_skin_fn *skin;
    shade_eye_fn *eye;
    shade_cloth_fn *cloth;
    shade_strand_fn *strand;
};
/* Those that cpu_level allows. */
const struct shade_kernels *shade_kernels(void);

#endif
