/* The built-in head: a sound mesh, a sound rig, and anatomy that holds for
 * other people too. */
#include "lib/lab/head/sculpt.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/head/lbs.h"
#include "tests/check.h"

enum { PEOPLE = 10, DIRS = SCULPT_SHAPES + SCULPT_EXPRESSIONS };

static void *sculpt_room(size_t n, size_t size)
{
    void *p = calloc(n, size);

    if (!p) {
        fprintf(stderr, "out of memory\n");
        exit(1);
    }
    return p;
}

/* ---- mesh ------------------------------------------------------------- */

struct edge { int32_t a, b; };

static int by_ends(const void *x, const void *y)
{
    const struct edge *e = x, *f = y;

    if (e->a != f->a)
        return e->a < f->a ? -1 : 1;
    return (e->b > f->b) - (e->b < f->b);
}

static struct edge *directed_edges(const struct sculpt *s)
{
    struct edge *e = sculpt_room(3 * s->nf, sizeof *e);

    for (size_t i = 0; i < 3 * s->nf; i++)
        e[i] = (struct edge){ s->f[i],
                              s->f[i % 3 == 2 ? i - 2 : i + 1] };
    qsort(e, 3 * s->nf, sizeof *e, by_ends);
    return e;
}

/* Follow the edges that have no partner; the number of closed loops, or -1
 * where two meet in a vertex. */
static int boundary_loops(const struct sculpt *s, const struct edge *e)
{
    int32_t *next = sculpt_room(s->nv, sizeof *next);
    int loops = 0;

    memset(next, 0xff, s->nv * sizeof *next);
    for (size_t i = 0; i < 3 * s->nf; i++) {
        struct edge back = { e[i].b, e[i].a };
        if (bsearch(&back, e, 3 * s->nf, sizeof *e, by_ends))
            continue;
        if (next[e[i].a] >= 0) {
            free(next);
            return -1;
        }
        next[e[i].a] = e[i].b;
    }
    for (size_t v = 0; v < s->nv; v++) {
        int32_t at = (int32_t)v;
        loops += next[at] >= 0;
        while (next[at] >= 0) {
            int32_t to = next[at];
            next[at] = -1;
            at = to;
        }
    }
    free(next);
    return loops;
}

static double sculpt_volume(const struct sculpt *s)
{
    double sum = 0;

    for (size_t i = 0; i < s->nf; i++) {
        const float *a = s->v_template + 3 * s->f[3 * i];
        const float *b = s->v_template + 3 * s->f[3 * i + 1];
        const float *c = s->v_template + 3 * s->f[3 * i + 2];
        sum += a[0] * (b[1] * c[2] - b[2] * c[1]) +
               a[1] * (b[2] * c[0] - b[0] * c[2]) +
               a[2] * (b[0] * c[1] - b[1] * c[0]);
    }
    return sum / 6;
}

static void test_mesh(const struct sculpt *s)
{
    struct edge *e = directed_edges(s);
    size_t twice = 0, used = 0, lost = 0;
    char *seen = sculpt_room(s->nv, 1);

    for (size_t i = 1; i < 3 * s->nf; i++)
        twice += !by_ends(&e[i - 1], &e[i]);
    for (size_t i = 0; i < 3 * s->nf; i++)
        seen[s->f[i]] = 1;
    for (size_t v = 0; v < s->nv; v++)
        used += seen[v] != 0;
    for (size_t i = 0; i < 3 * s->nf; i++) {   /* mirrored edges run back */
        struct edge m = { s->mirror[e[i].b], s->mirror[e[i].a] };
        lost += !bsearch(&m, e, 3 * s->nf, sizeof *e, by_ends);
    }
    check_range("vertices", (double)s->nv, 4800, 5300);
    check_range("vertices without a face", (double)(s->nv - used), 0, 0);
    check_range("edges run twice in one direction", (double)twice, 0, 0);
    check_range("openings: neck, mouth, two eyes", boundary_loops(s, e), 4, 4);
    check_range("edges without a mirror image", (double)lost, 0, 0);
    /* 6.4 litres of skin less the openings' cones, and two eyeballs */
    check_range("enclosed volume, litres", sculpt_volume(s) * 1e3, 4, 9);
    free(e);
    free(seen);
}

static void test_mirror(const struct sculpt *s)
{
    double worst = 0, broken = 0;

    for (size_t v = 0; v < s->nv; v++) {
        const float *p = s->v_template + 3 * v;
        const float *q = s->v_template + 3 * s->mirror[v];
        broken += s->mirror[s->mirror[v]] != (int32_t)v;
        worst = fmax(worst, fabs(p[0] + q[0]) + fabs(p[1] - q[1]) +
                            fabs(p[2] - q[2]));
    }
    check_range("mirror of the mirror is not the vertex", broken, 0, 0);
    check_range("asymmetry of the mean, m", worst, 0, 0);
}

/* ---- arrays ------------------------------------------------------------- */

static void test_sums(const struct sculpt *s)
{
    double skin = 0, joint = 0, least = 0;

    for (size_t v = 0; v < s->nv; v++) {
        double sum = 0;
        for (size_t j = 0; j < SCULPT_JOINTS; j++) {
            sum += s->weights[v * SCULPT_JOINTS + j];
            least = fmin(least, s->weights[v * SCULPT_JOINTS + j]);
        }
        skin = fmax(skin, fabs(sum - 1));
    }
    for (size_t j = 0; j < SCULPT_JOINTS; j++) {
        double sum = 0;
        for (size_t v = 0; v < s->nv; v++)
            sum += s->j_regressor[j * s->nv + v];
        joint = fmax(joint, fabs(sum - 1));
    }
    check_range("sum of skinning weights, off by", skin, 0, 1e-6);
    /* the root takes what is left of 1: down to half an ulp of 1 under 0 */
    check_range("smallest skinning weight", least, -6e-8, 0);
    check_range("sum of regressor rows, off by", joint, 0, 1e-5);
}

static void test_directions(const struct sculpt *s)
{
    size_t n = 3 * s->nv;
    float *row = sculpt_room(SCULPT_SHAPES * n, sizeof *row);
    double before = INFINITY, rise = -1, worst = 0;

    for (size_t k = 0; k < SCULPT_SHAPES; k++) {     /* unit rows */
        double sum = 0;
        for (size_t i = 0; i < n; i++)
            sum += (double)s->shapedirs[i * DIRS + k] *
                   s->shapedirs[i * DIRS + k];
        rise = fmax(rise, sqrt(sum) / before - 1);
        before = sqrt(sum);
        for (size_t i = 0; i < n; i++)
            row[k * n + i] = (float)(s->shapedirs[i * DIRS + k] / before);
    }
    for (size_t k = 1; k < SCULPT_SHAPES; k++)
        for (size_t j = 0; j < k; j++) {
            double sum[4] = { 0 };
            for (size_t i = 0; i < n; i++)
                sum[i & 3] += (double)row[k * n + i] * row[j * n + i];
            worst = fmax(worst, fabs(sum[0] + sum[1] + sum[2] + sum[3]));
        }
    check_range("norm of a shape over the one before, less 1", rise, -1, 1e-6);
    check_range("shortest shape, m", before, 1e-4, 1);
    check_range("largest cosine between two shapes", worst, 0, 1e-6);
    free(row);
}

static void test_landmarks(const struct sculpt *s)
{
    double sum = 0, least = 0, range = 0;

    for (size_t k = 0; k < SCULPT_LANDMARKS; k++) {
        const float *b = s->landmark_bary + 3 * k;
        sum = fmax(sum, fabs(b[0] + b[1] + b[2] - 1.0));
        least = fmin(least, fmin(b[0], fmin(b[1], b[2])));
        range += s->landmark_face[k] < 0 ||
                 (size_t)s->landmark_face[k] >= s->nf;
    }
    check_range("barycentric coordinates, sum off by", sum, 0, 1e-6);
    check_range("smallest barycentric coordinate", least, 0, 0);
    check_range("landmarks on no face", range, 0, 0);
}

/* ---- anatomy, for the mean and other people ----------------------------- */

/* Centre and radius of an eyeball: side 1 left, -1 right; head units. */
static double sculpt_eyeball(double c[3], const struct sculpt *s,
                             const float *verts, int side)
{
    double n = 0, r = 0;
    double lo[3] = { 1e9, 1e9, 1e9 }, hi[3] = { -1e9, -1e9, -1e9 };

    for (size_t v = 0; v < s->nv; v++)
        if (s->region[v] == REGION_EYEBALL &&
            s->v_template[3 * v] * (float)side > 0) {
            for (int d = 0; d < 3; d++) {
                lo[d] = fmin(lo[d], verts[3 * v + (size_t)d]);
                hi[d] = fmax(hi[d], verts[3 * v + (size_t)d]);
            }
            n++;
        }
    for (int d = 0; d < 3; d++)
        c[d] = 0.5 * (lo[d] + hi[d]);
    for (size_t v = 0; v < s->nv && n > 0; v++)
        if (s->region[v] == REGION_EYEBALL &&
            s->v_template[3 * v] * (float)side > 0)
            r += hypot(hypot(verts[3 * v] - c[0], verts[3 * v + 1] - c[1]),
                       verts[3 * v + 2] - c[2]) / n;
    return r;
}

/* Vertices on the mesh's border: around the eye, the lids' last loop, tucked
 * out of sight behind their margin. */
static char *sculpt_border(const struct sculpt *s)
{
    struct edge *e = directed_edges(s);
    char *on = sculpt_room(s->nv, 1);

    for (size_t i = 0; i < 3 * s->nf; i++) {
        struct edge back = { e[i].b, e[i].a };
        if (!bsearch(&back, e, 3 * s->nf, sizeof *e, by_ends))
            on[e[i].a] = on[e[i].b] = 1;
    }
    free(e);
    return on;
}

/* Least distance from the ball's surface, mm, of the lid vertices with
 * hidden[v] equal to which (200 mm are one head unit). */
static double sculpt_clearance(const struct sculpt *s, const float *verts,
                               const char *hidden, int which)
{
    double least = 1e9;

    for (int side = -1; side <= 1; side += 2) {
        double c[3], r = sculpt_eyeball(c, s, verts, side);
        for (size_t v = 0; v < s->nv; v++)
            if (s->region[v] == REGION_EYELID && hidden[v] == which &&
                s->v_template[3 * v] * (float)side > 0)
                least = fmin(least, 200 * (hypot(hypot(
                    verts[3 * v] - c[0], verts[3 * v + 1] - c[1]),
                    verts[3 * v + 2] - c[2]) - r));
    }
    return least;
}

/* Least height of the upper half of the inner ring over the lower one at the
 * same place, mm.  The ring runs from the left corner along the upper lip to
 * the right corner and back along the lower one. */
static double lip_gap(const struct sculpt *s, const float *verts)
{
    size_t n = s->n_lip_inner;
    double least = 1e9;

    for (size_t j = 1; j < n / 2; j++) {
        const float *up = verts + 3 * s->lip_inner[j];
        const float *low = verts + 3 * s->lip_inner[n - j];
        least = fmin(least, 200 * (up[1] - low[1]));
    }
    return least;
}

/* Least over the mean or ten people with coefficients N(0, 1), mm. */
static void test_people(const struct sculpt *s, const struct head *h,
                        int first, int last)
{
    float beta[SCULPT_SHAPES], *verts = sculpt_room(3 * s->nv, sizeof *verts);
    double closing = 1e9, tucked = 1e9, open = 1e9, closed = 1e9, gap = 1e9;
    char *hidden = sculpt_border(s);

    for (int person = first; person <= last; person++) {
        struct identity id;
        struct random r;
        random_init(&r, (uint64_t)person, "head_sculpt person");
        for (int k = 0; k < SCULPT_SHAPES; k++)
            beta[k] = person ? (float)random_normal(&r) : 0;
        if (head_fold(&id, h, beta, SCULPT_SHAPES, NULL))
            exit(1);
        for (int step = 0; step <= 8; step++) {
            struct head_motion m = { .lid = { 0.125f * (float)step,
                                              0.125f * (float)step } };
            head_pose(verts, &id, &m);
            double c = sculpt_clearance(s, verts, hidden, 0);
            closing = fmin(closing, c);
            tucked = fmin(tucked, sculpt_clearance(s, verts, hidden, 1));
            if (step == 0)
                gap = fmin(gap, lip_gap(s, verts));
            if (step == 0)
                open = fmin(open, c);
            if (step == 8)
                closed = fmin(closed, c);
        }
        identity_release(&id);
    }
    printf("%s:\n", last ? "ten people" : "the mean");
    check_range("lid clearance, open, mm", open, 0.3, 1.2);
    check_range("lid clearance, closed, mm", closed, 0.3, 1.2);
    check_range("least of any while closing, mm", closing, 0.05, 1.2);
    /* the hidden loop takes the chord where the margin clears the arc */
    check_range("the loop behind the margin, mm", tucked, -0.35, 1.2);
    /* A known limit: shape directions 44 and 36 (lower and upper lip) alone
     * change the gap by 1.3 and 1.2 mm per unit, so people may have lips that
     * overlap at rest; it must not get worse. */
    check_range("lips apart at rest, mm", gap, last ? -6.5 : 0.02, 1.2);
    free(hidden);
    free(verts);
}

static void test_mean(const struct sculpt *s, const struct head *h)
{
    struct head_mouth mouth;
    double l[3], r[3];

    head_mouth(&mouth, h, h->v_template);
    double radius = 200 * sculpt_eyeball(l, s, h->v_template, 1);
    sculpt_eyeball(r, s, h->v_template, -1);
    check_range("d_bowl, mm", 200 * mouth.bowl, 11.6, 12.0);
    check_range("d_lip, mm", 200 * mouth.lip, 16.4, 16.8);
    check_range("eyeball radius, mm", radius, 11.9, 12.1);
    check_range("between the pupils, mm", 200 * (l[0] - r[0]), 62, 64);
    for (int d = 0; d < 3; d++)
        check_range("left eye joint off the ball's centre, mm",
                    200 * (h->joint_template[3 * JOINT_EYE_LEFT + d] - l[d]),
                    -0.2, 0.2);
}

/* A jaw turned by 0.25 opens the mouth and leaves the upper face alone. */
static void test_jaw(const struct sculpt *s, const struct head *h)
{
    float *a = sculpt_room(3 * s->nv, sizeof *a),
          *b = sculpt_room(3 * s->nv, sizeof *b);
    struct head_motion rest = { 0 }, open = { .jaw = { 0.25f, 0, 0 } };
    struct head_mouth before, after;
    struct identity id;
    double upper = 0;

    if (head_fold(&id, h, NULL, 0, NULL))
        exit(1);
    head_pose(a, &id, &rest);
    head_pose(b, &id, &open);
    head_mouth(&before, h, a);
    head_mouth(&after, h, b);
    for (size_t v = 0; v < s->nv; v++)
        if (s->v_template[3 * v + 1] > 0.01f)
            for (size_t d = 0; d < 3; d++)
                upper = fmax(upper, 200 * fabs(a[3 * v + d] - b[3 * v + d]));
    check_range("mouth opens by, mm", 200 * (after.gap - before.gap), 10, 40);
    check_range("upper face moves by, mm", upper, 0, 1);
    identity_release(&id);
    free(a);
    free(b);
}

/* ---- the same twice ------------------------------------------------------ */

static void test_twice(const struct sculpt *s)
{
    struct sculpt t;
    size_t v = s->nv;

    if (sculpt_make(&t, NULL))
        exit(1);
    int same = t.nv == s->nv && t.nf == s->nf &&
        !memcmp(t.v_template, s->v_template, 3 * v * sizeof(float)) &&
        !memcmp(t.f, s->f, 3 * s->nf * sizeof(int32_t)) &&
        !memcmp(t.shapedirs, s->shapedirs, 3 * v * DIRS * sizeof(float)) &&
        !memcmp(t.posedirs, s->posedirs,
                3 * v * SCULPT_POSES * sizeof(float)) &&
        !memcmp(t.weights, s->weights, SCULPT_JOINTS * v * sizeof(float)) &&
        !memcmp(t.l_eyelid, s->l_eyelid, 3 * v * sizeof(float)) &&
        !memcmp(t.hair, s->hair, v * sizeof(float));
    check_range("made twice, the same bytes", same, 1, 1);
    sculpt_release(&t);
}

int main(void)
{
    struct error err = {0};
    struct head_arrays a;
    struct head h = {0};
    struct sculpt s;

    if (sculpt_make(&s, &err)) {
        printf("%s\n", err.text);
        return 1;
    }
    test_mesh(&s);
    test_mirror(&s);
    test_sums(&s);
    test_directions(&s);
    test_landmarks(&s);
    sculpt_arrays(&a, &s);
    if (head_init(&h, &a, &err)) {
        printf("%s\n", err.text);
        return 1;
    }
    test_mean(&s, &h);
    test_people(&s, &h, 0, 0);
    test_people(&s, &h, 1, PEOPLE);
    test_jaw(&s, &h);
    test_twice(&s);
    head_release(&h);
    sculpt_release(&s);
    return check_status();
}
