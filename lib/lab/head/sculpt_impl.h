/* Inside the sculptor: one half of the head (x >= 0) in millimetres, built
 * of quads, mirrored at the end.  Not for other modules. */
#ifndef SPID_LAB_HEAD_SCULPT_IMPL_H
#define SPID_LAB_HEAD_SCULPT_IMPL_H

#include <math.h>
#include <stdbool.h>

#include "lib/lab/head/sculpt.h"

struct vec { double x, y, z; };

static inline struct vec vec(double x, double y, double z)
{
    return (struct vec){ x, y, z };
}
static inline struct vec add(struct vec a, struct vec b)
{
    return vec(a.x + b.x, a.y + b.y, a.z + b.z);
}
static inline struct vec sub(struct vec a, struct vec b)
{
    return vec(a.x - b.x, a.y - b.y, a.z - b.z);
}
static inline struct vec mul(struct vec a, double s)
{
    return vec(a.x * s, a.y * s, a.z * s);
}
static inline double dot(struct vec a, struct vec b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
static inline struct vec cross(struct vec a, struct vec b)
{
    return vec(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z,
               a.x * b.y - a.y * b.x);
}
static inline double norm(struct vec a) { return sqrt(dot(a, a)); }
static inline struct vec unit(struct vec a)
{
    double n = norm(a);
    return n > 0 ? mul(a, 1 / n) : a;
}
static inline struct vec lerp(struct vec a, struct vec b, double t)
{
    return add(mul(a, 1 - t), mul(b, t));
}
static inline double mix(double a, double b, double t)
{
    return a + (b - a) * t;
}
static inline double clamp01(double t) { return t < 0 ? 0 : t > 1 ? 1 : t; }
/* Smooth step from 0 at a to 1 at b (a > b falls). */
static inline double ramp(double a, double b, double t)
{
    t = clamp01((t - a) / (b - a));
    return t * t * (3 - 2 * t);
}

/* ---- topology -------------------------------------------------------------
 * A grid wraps half the head: column 0 is the front midline, column COLS the
 * back midline, row 0 the cut neck, row ROWS the rim of the crown.  Blocks of
 * cells are cut out for eye, mouth, ear and nostril and filled with
 * concentric rings of as many vertices as the block's border has. */
enum {
    COLS = 32, ROWS = 43,
    CAP = 8,                                   /* crown: CAP x 2 CAP cells */
    EYE_C0 = 3, EYE_C1 = 13, EYE_R0 = 28, EYE_R1 = 36,
    EYE_N = 2 * (EYE_C1 - EYE_C0 + EYE_R1 - EYE_R0),         /* 36 */
    EYE_RINGS = 9, EYE_MARGIN = 7, EYE_INNER = 8,
    MOUTH_C1 = 9, MOUTH_R0 = 12, MOUTH_R1 = 20,
    MOUTH_N = 2 * MOUTH_C1 + MOUTH_R1 - MOUTH_R0,            /* 26 cells */
    MOUTH_CORNER = MOUTH_N / 2,
    MOUTH_RINGS = 11, LIP_SKIN = 4, LIP_BORDER = 5, LIP_INNER = 9,
    EAR_C0 = 15, EAR_C1 = 20, EAR_R0 = 20, EAR_R1 = 32,
    EAR_N = 2 * (EAR_C1 - EAR_C0 + EAR_R1 - EAR_R0),         /* 34 */
    EAR_RINGS = 11,
    NOS_C0 = 1, NOS_C1 = 3, NOS_R0 = 21, NOS_R1 = 23,
    NOS_N = 8, NOS_RINGS = 3,
    BALL_RINGS = 9, BALL_N = 18,
    HALF_VERTS = 4000, HALF_QUADS = 4000
};

enum part {
    PART_GRID, PART_CAP, PART_EYE, PART_MOUTH, PART_EAR, PART_NOSTRIL,
    PART_BALL
};

struct half {
    int nv, nq;
    struct vec p[HALF_VERTS];
    double hold[HALF_VERTS];      /* 0 relaxes freely ... 1 authored */
    double snap[HALF_VERTS];      /* how much it follows the base surface */
    unsigned char part[HALF_VERTS], ring[HALF_VERTS], seam[HALF_VERTS];
    short col[HALF_VERTS], row[HALF_VERTS];    /* grid; index in the ring */
    int quad[HALF_QUADS][4];      /* [3] < 0: a triangle */
    int grid[ROWS + 1][COLS + 1]; /* -1 inside a block */
    int cap[CAP + 1][2 * CAP + 1];
    int eye[EYE_RINGS + 1][EYE_N];
    int mouth[MOUTH_RINGS + 1][MOUTH_N + 1];
    int ear[EAR_RINGS + 1][EAR_N];
    int ear_fill[EAR_R1 - EAR_R0 + 1][EAR_C1 - EAR_C0 + 1];
    int nostril[NOS_RINGS + 1][NOS_N];
    int nostril_fill[3][3];
    int ball_first;               /* first vertex of the eyeball: front pole */
};

/* Connectivity; positions are left at zero. */
void sculpt_topology(struct half *h);

/* The crown and the grid near the base surface, before relaxation. */
void sculpt_grid_guess(struct half *h);

/* Signed distance of the base surface (negative inside), mm. */
double sculpt_surface(struct vec p);
/* Its unit gradient, outwards. */
struct vec sculpt_surface_normal(struct vec p);
/* Nearest point along the gradient. */
struct vec sculpt_surface_project(struct vec p);
/* First hit of a ray from `from` along unit `dir`. */
struct vec sculpt_surface_ray(struct vec from, struct vec dir);
/* Small authored dents and swellings along the normal, mm. */
double sculpt_surface_detail(struct vec p);

/* Authored parts: set p and hold of their rings. */
void sculpt_eye(struct half *h);
/* Lips and the bag behind them. */
void sculpt_lips(struct half *h);
/* The left ear. */
void sculpt_ear(struct half *h);
/* The left nostril. */
void sculpt_nostril(struct half *h);

/* Centre of the left eyeball and its radius, mm. */
#define EYE_CENTRE vec(31.5, 25, 68)
#define EYE_RADIUS 12.0

/* The last few millimetres, after directions and weights were made. */
int sculpt_finish(struct half *h);

/* The lid vertices' movement when the left eye closes, mm. */
void sculpt_eyelid(const struct half *h, struct vec *delta);

/* ---- the whole head -------------------------------------------------------
 * Full mesh in millimetres: vertices of the half first, then mirror images
 * of those off the midline. */
struct full {
    int nv, nf, nhalf;
    struct vec *p, *n;            /* position, smooth normal */
    int (*f)[3];
    int *src, *mirror;            /* half vertex; opposite vertex */
    signed char *side;            /* +1 left, -1 right, 0 midline */
    const struct half *h;
    int *nbr_at, *nbr;            /* neighbours of v: nbr[nbr_at[v]..] */
};
/* Both halves with their neighbours; -1 when memory is short. */
int sculpt_full_init(struct full *m, const struct half *h);
/* Free what it holds; zeroed then. */
void sculpt_full_release(struct full *m);

/* How much the jaw carries vertex src of the half, at p in the whole. */
double sculpt_jaw_weight(const struct half *h, int src, struct vec p);

/* The identity directions of s->shapedirs, both halves.  This and the next
 * three return -1 when memory is short. */
int sculpt_shapes(struct sculpt *s, const struct full *m);
/* The expression directions behind them. */
int sculpt_expressions(struct sculpt *s, const struct full *m);
/* Joints, skinning weights, pose correctives and lids. */
int sculpt_rig(struct sculpt *s, const struct full *m);
/* Regions, hair, texture places, lip rings and landmarks. */
int sculpt_labels(struct sculpt *s, const struct full *m);

#endif
