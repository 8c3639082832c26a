/* The scans' identities and expressions at our vertices. */
#include "lib/lab/head/transfer.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/vec3.h"
#include "lib/head/arkit.h"
#include "lib/head/head.h"

#define NECK_HOLD 0.85f         /* share of its widening that is taken away */

enum { DIRS = TEMPLATE_DIRECTIONS };

/* ---- shapes ------------------------------------------------------------- */

/* Balls of a shape: (SCAN_VERTS,3) the face with it, NULL when they stay. */
static void transfer_move_balls(double *d, const struct registration *r,
                                const float *face)
{
    for (int right = 0; right < 2; right++) {
        double shift[3] = {0}, grow = 0, eye[3];

        scan_eye(eye, right);
        if (face)
            scan_eye_motion(shift, &grow, r->scan->neutral, face, 1, right);
        for (size_t v = 0; v < r->s->nv; v++) {
            const float *p = r->s->v_template + 3 * v;
            int here = r->s->region[v] == REGION_EYEBALL &&
                       (p[0] < 0) == right;

            for (size_t c = 0; here && c < 3; c++)
                d[3 * v + c] = shift[c] + grow * ((double)p[c] - eye[c]);
        }
    }
}

/* A shape of the scans (SCAN_VERTS,3) on our vertices: d (nv,3).  Balls move
 * rigidly and grow when `balls`, else stay.  Beyond the scans d is harmonic,
 * and goes to 0 at the neck's cut when `pinned`. */
static int transfer_shape(double *d, const struct registration *r,
                          const float *shape, int pinned, int balls,
                          struct error *err)
{
    enum { ROUNDS = 300 };      /* the neck below the scans is 12 rows high */
    size_t nv = r->s->nv;
    float *face = calloc(3 * SCAN_VERTS, sizeof *face);

    if (!face)
        return error_set(err, EX_OSERR, "no memory for a shape");
    for (size_t i = 0; i < 3 * SCAN_VERTS; i++)
        face[i] = r->scan->neutral[i] + shape[i];
    memset(d, 0, 3 * nv * sizeof *d);
    for (size_t v = 0; v < nv; v++)
        if (r->match[v].trust > 0)
            match_point(d + 3 * v, &r->match[v], shape);
    for (int round = 0; round < ROUNDS; round++)
        for (size_t v = 0; v < nv; v++) {
            double mean[3], own[3], trust = r->match[v].trust;

            if (trust >= 1 || r->s->region[v] == REGION_EYEBALL)
                continue;
            surface_mean(mean, &r->mesh, d, v);
            match_point(own, &r->match[v], shape);
            for (size_t c = 0; c < 3; c++)
                d[3 * v + c] = pinned && r->s->v_template[3 * v + 1] < -0.16f
                    ? 0 : mean[c] + trust * (own[c] - mean[c]);
        }
    transfer_move_balls(d, r, balls ? face : NULL);
    free(face);
    return 0;
}

/* The scans' identities are even or odd under mirroring: what rounding has
 * left of the other kind goes. */
static void transfer_make_pure(double *d, const struct registration *r)
{
    const size_t *mirror = r->mirror;
    const size_t nv = r->s->nv;
    double with = 0;

    for (size_t v = 0; v < nv; v++) {
        const double *a = d + 3 * v, *b = d + 3 * mirror[v];

        with += a[1] * b[1] + a[2] * b[2] - a[0] * b[0];
    }
    double sign = with < 0 ? -1 : 1;
    for (size_t v = 0; v < nv; v++) {
        size_t w = mirror[v];

        for (size_t c = 0; w >= v && c < 3; c++) {
            double flip = c == 0 ? -sign : sign;
            double a = (d[3 * v + c] + flip * d[3 * w + c]) / 2;

            d[3 * v + c] = a;
            d[3 * w + c] = flip * a;
        }
    }
}

/* Column k of s->shapedirs = d (nv,3). */
static void transfer_store(struct template *s, size_t k, const double *d)
{
    for (size_t i = 0; i < 3 * s->nv; i++)
        s->shapedirs[i * DIRS + k] = d ? (float)d[i] : 0;
}

/* The scans' identities, in place of the first shapes. */
static int transfer_carry_identities(struct template *s,
                                     const struct registration *r, double *d,
                                     struct error *err)
{
    for (size_t k = 0; k < SCAN_IDENTITIES; k++) {
        if (transfer_shape(d, r, r->scan->identity + k * 3 * SCAN_VERTS, 0, 1,
                           err))
            return -1;
        transfer_make_pure(d, r);
        transfer_store(s, k, d);
    }
    return 0;
}

/* Below the jaw's angle a jaw that opens widens the scans' necks by up to 8 mm
 * on either side, and they would stand out like wings beside the cheeks, which it
 * draws in.  A neck keeps its width. */
static void transfer_hold_neck(double *open, const struct registration *r)
{
    for (size_t v = 0; v < r->s->nv; v++) {
        const float *p = r->s->v_template + 3 * v;
        const float aside = ramp(0.025f, 0.035f, fabsf(p[0]));
        const float below = ramp(-0.050f, -0.070f, p[1]);

        if (open[3 * v] * (double)p[0] > 0)
            open[3 * v] *= (double)(1 - NECK_HOLD * aside * below);
    }
}

/* The scans' expressions through the registration, behind the identities. */
static int transfer_carry_expressions(struct template *s,
                                      const struct registration *r,
                                      struct error *err)
{
    double *all = calloc(3 * s->nv * ARKIT_COUNT, sizeof *all);
    int rc = all ? 0 : error_set(err, EX_OSERR, "no memory for expressions");

    for (size_t k = 0; !rc && k < ARKIT_COUNT; k++)
        rc = transfer_shape(all + 3 * s->nv * k, r, r->scan->expression +
                            k * 3 * SCAN_VERTS, 1, 0, err);
    if (!rc)
        transfer_hold_neck(all + 3 * s->nv * ARKIT_JAW_OPENED, r);
    for (size_t k = 0; !rc && k < TEMPLATE_EXPRESSIONS; k++)
        transfer_store(s, TEMPLATE_SHAPES + k,
                       k < ARKIT_COUNT && !arkit_is_rig((int)k)
                           ? all + 3 * s->nv * k
                           : NULL);
    if (!rc)
        transfer_rig(s, all);
    free(all);
    return rc;
}

int transfer_head(struct template *s, const struct registration *r,
                  struct error *err)
{
    double *d = calloc(3 * s->nv, sizeof *d);
    int rc = d ? 0 : error_set(err, EX_OSERR, "no memory for the scans' head");

    rc = rc || transfer_carry_identities(s, r, d, err) ||
         transfer_carry_expressions(s, r, err) ||
         transfer_lids(s, r, err) ? -1 : 0;
    free(d);
    return rc;
}
