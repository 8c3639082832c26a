/* The scans' identities, expressions and landmarks at our vertices. */
#include "lib/lab/head/transfer.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/rotation.h"
#include "lib/head/arkit.h"
#include "lib/lab/head/nearest.h"

#define NECK_HOLD 0.85          /* share of its widening that is taken away */

enum { DIRS = TEMPLATE_DIRECTIONS };

/* ---- eyes --------------------------------------------------------------- */

/* Polar angles of the ball's rings, degrees: pupil 2 mm, iris 5.9 mm. */
static const double polar[BALL_RINGS] = { 7.8, 15.6, 23.5, 33, 46, 63, 88,
    115, 145 };

/* Both balls' vertices: rings about the axis. */
static void transfer_place_balls(double *at, const struct registration *r)
{
    for (int right = 0; right < 2; right++) {
        double eye[3], axis[3];
        int first = r->h->ball_first, last = first + BALL_RINGS * BALL_N + 1;

        scan_eye(eye, right);
        scan_eye_axis(axis, right);
        const double *n = axis, flat = sqrt(1 - n[1] * n[1]);
        const double up[3] = { -n[0] * n[1] / flat, flat,
                               -n[2] * n[1] / flat };
        double out[3];

        cross3_d(out, up, n);
        for (int v = first; v <= last; v++) {
            int i = v - first - 1, ring = i < 0 ? -1 : i / BALL_N;
            double a = ring < 0 ? 0 : v == last ? M_PI
                     : polar[ring] * M_PI / 180;
            double b = 2 * M_PI * (i % BALL_N) / BALL_N;
            double side = right ? -1 : 1;
            double *q = at + 3 * (right ? r->h->mirror[v] : v);

            for (int c = 0; c < 3; c++)
                q[c] = eye[c] + SCAN_EYE_RADIUS *
                       (n[c] * cos(a) + (side * out[c] * cos(b) +
                                         up[c] * sin(b)) * sin(a));
        }
    }
}

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
            int here = r->s->region[v] == REGION_EYEBALL &&
                       (r->at[3 * v] < 0) == right;

            for (size_t c = 0; here && c < 3; c++)
                d[3 * v + c] = shift[c] + grow * (r->at[3 * v + c] - eye[c]);
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
            smooth_mean(mean, &r->mesh, d, v);
            match_point(own, &r->match[v], shape);
            for (size_t c = 0; c < 3; c++)
                d[3 * v + c] = pinned && r->at[3 * v + 1] < -0.16 ? 0
                             : mix(mean[c], own[c], trust);
        }
    transfer_move_balls(d, r, balls ? face : NULL);
    free(face);
    return 0;
}

/* The scans' identities are even or odd under mirroring: what rounding has
 * left of the other kind goes. */
static void transfer_make_pure(double *d, const struct registration *r)
{
    const int *mirror = r->h->mirror;
    const size_t nv = r->s->nv;
    double with = 0;

    for (size_t v = 0; v < nv; v++) {
        const double *a = d + 3 * v, *b = d + 3 * mirror[v];

        with += a[1] * b[1] + a[2] * b[2] - a[0] * b[0];
    }
    double sign = with < 0 ? -1 : 1;
    for (size_t v = 0; v < nv; v++) {
        size_t w = (size_t)mirror[v];

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
        const double *p = r->at + 3 * v;
        const double aside = ramp(0.025, 0.035, fabs(p[0]));
        const double below = ramp(-0.050, -0.070, p[1]);

        if (open[3 * v] * p[0] > 0)
            open[3 * v] *= 1 - NECK_HOLD * aside * below;
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
        rc = transfer_rig(s, all, err);
    free(all);
    return rc;
}

/* ---- landmarks ---------------------------------------------------------- */

/* Landmarks are the scans', on the faces of our skin. */
static int transfer_carry_landmarks(struct template *s, const struct scan *scan,
                                    struct error *err)
{
    struct nearest t;
    struct arena room = {0};
    int32_t *skin = arena_take(&room, 3 * s->nf, sizeof *skin);
    int32_t *from = arena_take(&room, s->nf, sizeof *from);
    size_t n = 0;
    int rc = arena_check(&room, "landmarks", err);

    for (size_t i = 0; !rc && i < s->nf; i++)
        if (s->region[s->f[3 * i]] != REGION_EYEBALL) {
            memcpy(skin + 3 * n, s->f + 3 * i, 3 * sizeof *skin);
            from[n++] = (int32_t)i;
        }
    rc = rc || nearest_init(&t, s->v_template, skin, n, &room, err) ? -1 : 0;
    for (int k = 0; !rc && k < TEMPLATE_LANDMARKS; k++) {
        struct nearest_hit hit;
        const float *q = scan->neutral + 3 * scan_landmarks[k];
        double p[3] = {q[0], q[1], q[2]};

        nearest_find(&hit, &t, p, NULL, 0, 1);
        s->landmark_face[k] = from[hit.face];
        for (int c = 0; c < 3; c++)
            s->landmark_bary[3 * k + c] = (float)hit.bary[c];
    }
    arena_release(&room);
    return rc;
}

int transfer_head(struct template *s, const struct registration *r,
                  struct error *err)
{
    double *d = calloc(3 * s->nv, sizeof *d);
    int rc = -1;

    if (!d)
        return error_set(err, EX_OSERR, "no memory for the scans' head");
    transfer_place_balls(r->at, r);
    for (size_t i = 0; i < 3 * s->nv; i++)
        s->v_template[i] = (float)r->at[i];
    if (!transfer_carry_identities(s, r, d, err) &&
        !transfer_carry_expressions(s, r, err) && !transfer_lids(s, r, err))
        rc = transfer_carry_landmarks(s, r->scan, err);
    free(d);
    return rc;
}
