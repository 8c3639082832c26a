/* Our template laid on the scans' neutral face: which point of theirs each of
 * our vertices is.
 *
 * Rims first: lid margins and lips are loops in both meshes and are matched
 * loop by loop, along each by arc length.  These, the 68 landmarks and the
 * ears' outlines bend the template over (radial basis |r| plus affine); then
 * points nearest to it along its normals draw it on, less and less stiffly
 * (non-rigid iterated closest points), and it is evened out along the surface.
 * Left half; the right one is its mirror image, as the scans' neutral is. */
#ifndef SPID_LAB_HEAD_REGISTER_H
#define SPID_LAB_HEAD_REGISTER_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/lab/head/loops.h"
#include "lib/lab/head/scan.h"
#include "lib/lab/head/smooth.h"
#include "lib/lab/head/template.h"

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

/* A vertex is sum_k w_k scan vertex v_k, as far as it is trusted: 1 on the
 * scans' surface, 0 where they end (lower neck) or do not apply (eyeballs). */
struct match {
    int32_t v[4];
    double w[4];
    double trust;
};

struct registration {
    struct arena memory;
    const struct template *s;     /* borrowed */
    const struct scan *scan;
    struct loops *h;             /* our mesh's loops */
    struct smooth_mesh mesh;     /* and neighbours */
    struct match *match;        /* (nv) */
    double *at;                 /* (nv,3) where the template came to lie */
};

/* Lay the template of s (borrowed) on the neutral face of scan (borrowed).
 * -1 and *err when memory is short or the rims do not match. */
int registration_init(struct registration *r, const struct template *s,
                      const struct scan *scan, struct error *err);
/* Free what it holds; zeroed then. */
void registration_release(struct registration *r);

/* out (3) = the matched point in x (SCAN_VERTS,3): neutral or a shape. */
void match_point(double out[3], const struct match *m, const float *x);

/* ---- parts, for registration_init ---------------------------------------- */

/* Match lid loops 7 to 9 and lip loops 5 to 11 of the left half; trust 1. */
int register_rims(struct registration *r, struct error *err);

/* A place of the template and where it belongs, metres. */
struct control { double from[3], to[3]; };

/* The left half's and midline's controls beside the rims' own: landmarks,
 * ear.  Returns how many (at most room). */
size_t register_controls(struct control *c, size_t room,
                         const struct registration *r);

/* at (n,3) moved by the radial basis through the controls. */
int register_bend(double *at, size_t n, const struct control *c,
                  size_t count, struct error *err);

#endif
