#include "lib/head/transfer.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/head/arkit.h"
#include "lib/head/nearest.h"
#include "lib/head/smooth.h"

enum {
    DIRS = SCULPT_SHAPES + SCULPT_EXPRESSIONS,
    EXTRA = 40                  /* directions of skull and neck */
};

/* ---- eyes ------------------------------------------------------------------ */

/* The scans' sclera about the cornea, as a sphere: fitted to the vertices of
 * the left ball in front of z = 83 mm and 7 to 14.5 mm off its axis, which err
 * by 0.4 mm at most; the axis runs through the cornea's apex.  In centimetres
 * as the file has them. */
static const double eye_centre[3] = { 3.14497, 3.61090, 8.00981 };
static const double eye_apex[3] = { 3.23750, 3.61090, 9.64757 };
#define EYE_BALL 1.4799

void transfer_eye(struct transfer_eye *e, const struct scan *scan, int right)
{
    static const double shift[3] = {SCAN_SHIFT_X, SCAN_SHIFT_Y, SCAN_SHIFT_Z};
    double l = 0;

    (void)scan;
    for (int c = 0; c < 3; c++) {
        e->centre[c] = SCAN_SCALE * eye_centre[c] + shift[c];
        e->axis[c] = eye_apex[c] - eye_centre[c];
        l += e->axis[c] * e->axis[c];
    }
    for (int c = 0; c < 3; c++)
        e->axis[c] /= sqrt(l);
    if (right) {
        e->centre[0] *= -1;
        e->axis[0] *= -1;
    }
    e->radius = SCAN_SCALE * EYE_BALL;
}

/* Polar angles of the ball's rings, degrees: pupil 2 mm, iris 5.9 mm. */
static const double polar[BALL_RINGS] = { 7.8, 15.6, 23.5, 33, 46, 63, 88,
    115, 145 };

/* Both balls' vertices: rings about the axis. */
static void place_balls(double *at, const struct registration *r)
{
    for (int right = 0; right < 2; right++) {
        struct transfer_eye e;
        int first = r->h->ball_first, last = first + BALL_RINGS * BALL_N + 1;

        transfer_eye(&e, r->scan, right);
        struct vec n = vec(e.axis[0], e.axis[1], e.axis[2]);
        struct vec up = unit(sub(vec(0, 1, 0), mul(n, n.y)));
        struct vec out = cross(up, n);

        for (int v = first; v <= last; v++) {
            int i = v - first - 1, ring = i < 0 ? -1 : i / BALL_N;
            double a = ring < 0 ? 0 : v == last ? M_PI
                     : polar[ring] * M_PI / 180;
            double b = 2 * M_PI * (i % BALL_N) / BALL_N;
            struct vec p = add(mul(n, cos(a)),
                               mul(add(mul(out, (right ? -1 : 1) * cos(b)),
                                       mul(up, sin(b))), sin(a)));
            double *q = at + 3 * (right ? r->s->mirror[v] : v);

            q[0] = e.centre[0] + e.radius * p.x;
            q[1] = e.centre[1] + e.radius * p.y;
            q[2] = e.centre[2] + e.radius * p.z;
        }
    }
}

/* Shift and growth about its centre that say best how a shape moves an eye. */
static void eye_motion(double shift[3], double *grow, const float *shape,
                       const struct scan *scan, int right)
{
    int32_t first = right ? SCAN_EYE_RIGHT : SCAN_EYE_LEFT;
    const int32_t n = SCAN_IRIS_LEFT - SCAN_EYE_LEFT;
    double mean[3] = {0}, pd = 0, pp = 0;

    memset(shift, 0, 3 * sizeof *shift);
    for (int32_t v = first; v < first + n; v++)
        for (int c = 0; c < 3; c++) {
            shift[c] += shape[3 * v + c] / n;
            mean[c] += scan->neutral[3 * v + c] / n;
        }
    for (int32_t v = first; v < first + n; v++)
        for (int c = 0; c < 3; c++) {
            double p = scan->neutral[3 * v + c] - mean[c];

            pd += p * (shape[3 * v + c] - shift[c]);
            pp += p * p;
        }
    *grow = pd / pp;
    struct transfer_eye e;
    transfer_eye(&e, scan, right);
    for (int c = 0; c < 3; c++)     /* from the vertices' mean to the centre */
        shift[c] += *grow * (e.centre[c] - mean[c]);
}

/* ---- shapes ----------------------------------------------------------------- */

static void move_balls(double *d, const struct registration *r,
                       const float *shape, int balls)
{
    for (int right = 0; right < 2; right++) {
        double shift[3], grow;
        struct transfer_eye e;

        transfer_eye(&e, r->scan, right);
        eye_motion(shift, &grow, shape, r->scan, right);
        for (size_t v = 0; v < r->s->nv; v++) {
            int here = r->s->region[v] == REGION_EYEBALL &&
                       (r->at[3 * v] < 0) == right;

            for (size_t c = 0; here && c < 3; c++)
                d[3 * v + c] = balls ? shift[c] + grow * (r->at[3 * v + c] -
                                                          e.centre[c]) : 0;
        }
    }
}

int transfer_shape(double *d, const struct registration *r,
                   const float *shape, int pinned, int balls,
                   struct error *err)
{
    size_t nv = r->s->nv;
    double *target = calloc(4 * nv, sizeof *target), *weight;
    struct smooth_mesh mesh = {0};
    int rc = -1;

    if (!target)
        return error_set(err, EX_OSERR, "no memory for a shape");
    weight = target + 3 * nv;
    for (size_t v = 0; v < nv; v++) {
        const struct match *m = &r->match[v];

        if (m->trust > 0)
            match_point(target + 3 * v, m, shape);
        weight[v] = m->trust > 0 ? 100 * m->trust * m->trust
                  : pinned && r->at[3 * v + 1] < -0.15 ? 1 : 0;
    }
    memcpy(d, target, 3 * nv * sizeof *d);
    if (!smooth_mesh_init(&mesh, r->s->f, r->s->nf, nv, err))
        rc = smooth_fit(d, &mesh, target, weight, NULL, NULL, 1, 150, err);
    for (size_t i = 0; i < 3 * nv; i++)
        if (r->match[i / 3].trust >= 1)
            d[i] = target[i];
    move_balls(d, r, shape, balls);
    smooth_mesh_release(&mesh);
    free(target);
    return rc;
}

/* Column k of s->shapedirs = d (nv,3). */
static void store(struct sculpt *s, size_t k, const double *d)
{
    for (size_t i = 0; i < 3 * s->nv; i++)
        s->shapedirs[i * DIRS + k] = d ? (float)d[i] : 0;
}

/* Where the sculpted head's own variety is kept: skull and neck, not the face
 * and ears. */
static void extra_mask(double *mask, const struct registration *r)
{
    for (size_t v = 0; v < r->s->nv; v++) {
        const double *p = r->at + 3 * v;
        double neck = ramp(-0.085, -0.125, p[1] - 0.15 * fmin(0, p[2]));
        double skull = ramp(0.055, 0.10, p[1] + 0.5 * fmax(0, -p[2]) -
                                         0.3 * fmax(0, p[2] - 0.04));
        double ear = r->s->region[v] == REGION_EAR ||
                     r->s->region[v] == REGION_EYEBALL ? 0 : 1;

        mask[v] = ear * fmax(neck, 0.7 * skull);
    }
}

static int carry_identities(struct sculpt *s, const struct registration *r,
                            double *d, struct error *err)
{
    extra_mask(d, r);
    if (transfer_extras(s, SCAN_IDENTITIES, EXTRA, d, err))
        return -1;
    for (size_t k = 0; k < SCAN_IDENTITIES; k++) {
        if (transfer_shape(d, r, r->scan->identity + k * 3 * SCAN_VERTS, 0, 1,
                           err))
            return -1;
        store(s, k, d);
    }
    for (size_t k = SCAN_IDENTITIES + EXTRA; k < SCULPT_SHAPES; k++)
        store(s, k, NULL);
    return 0;
}

static int carry_expressions(struct sculpt *s, const struct registration *r,
                             struct error *err)
{
    double *all = calloc(3 * s->nv * ARKIT_COUNT, sizeof *all);
    int rc = all ? 0 : error_set(err, EX_OSERR, "no memory for expressions");

    for (size_t k = 0; !rc && k < ARKIT_COUNT; k++)
        rc = transfer_shape(all + 3 * s->nv * k, r, r->scan->expression +
                            k * 3 * SCAN_VERTS, 1, 0, err);
    for (size_t k = 0; !rc && k < SCULPT_EXPRESSIONS; k++)
        store(s, SCULPT_SHAPES + k, k < ARKIT_COUNT && !arkit_is_rig((int)k)
              ? all + 3 * s->nv * k : NULL);
    if (!rc)
        rc = transfer_rig(s, r, all, err);
    free(all);
    return rc;
}

/* ---- landmarks -------------------------------------------------------------- */

/* Landmarks are the scans', on the faces of our skin. */
static int carry_landmarks(struct sculpt *s, const struct scan *scan,
                           struct error *err)
{
    struct nearest t;
    int32_t *skin = malloc(3 * s->nf * sizeof *skin);
    int32_t *from = malloc(s->nf * sizeof *from);
    size_t n = 0;
    int rc = -1;

    if (!skin || !from) {
        error_set(err, EX_OSERR, "no memory for landmarks");
        goto out;
    }
    for (size_t i = 0; i < s->nf; i++)
        if (s->region[s->f[3 * i]] != REGION_EYEBALL) {
            memcpy(skin + 3 * n, s->f + 3 * i, 3 * sizeof *skin);
            from[n++] = (int32_t)i;
        }
    if (nearest_init(&t, s->v_template, skin, n, err))
        goto out;
    for (int k = 0; k < SCULPT_LANDMARKS; k++) {
        struct nearest_hit hit;
        const float *q = scan->neutral + 3 * scan_landmarks[k];
        double p[3] = {q[0], q[1], q[2]};

        nearest_find(&hit, &t, p, NULL, 0, 1);
        s->landmark_face[k] = from[hit.face];
        for (int c = 0; c < 3; c++)
            s->landmark_bary[3 * k + c] = (float)hit.bary[c];
    }
    nearest_release(&t);
    rc = 0;
out:
    free(skin);
    free(from);
    return rc;
}

int transfer_head(struct sculpt *s, const struct registration *r,
                  struct error *err)
{
    double *d = calloc(3 * s->nv, sizeof *d);
    int rc = -1;

    if (!d)
        return error_set(err, EX_OSERR, "no memory for the scans' head");
    place_balls(r->at, r);
    for (size_t i = 0; i < 3 * s->nv; i++)
        s->v_template[i] = (float)r->at[i];
    if (!carry_identities(s, r, d, err) && !carry_expressions(s, r, err))
        rc = carry_landmarks(s, r->scan, err);
    free(d);
    return rc;
}
