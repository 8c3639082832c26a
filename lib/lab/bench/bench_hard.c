/* Hard cases of every stage that has them: what each costs in time, and how
 * far it is from double precision. */
#include "lib/lab/bench/bench.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/random.h"
#include "lib/lab/bench/bench_splat.h"
#include "lib/base/crop.h"
#include "lib/base/rotation.h"
#include "lib/head/lbs.h"

/* A row among the hard cases. */
static int hard_add(struct bench *b, const char *stage, const char *config,
                    const char *knob, int threads, const struct bench_times *t,
                    double worst, double psnr, struct error *err)
{
    struct bench_row *r = bench_add(b, stage, config, knob, threads, t, worst,
                                    psnr);

    if (!r)
        return error_set(err, EX_OSERR, "out of memory");
    r->hard = true;
    return 0;
}

/* ---- rotations ---------------------------------------------------------- */

enum { TURNS = 1000 };

struct turns {
    float x[TURNS][6], R[TURNS][9];
    bool six;                   /* 6D; axis-angle otherwise */
};

/* All rotations once. */
static int hard_call_turns(void *context, struct error *err)
{
    struct turns *t = context;

    (void)err;
    for (int i = 0; i < TURNS; i++)
        if (t->six)
            rotation_6d(t->R[i], t->x[i]);
        else
            rotation_exp(t->R[i], t->x[i]);
    return 0;
}

/* Axis-angle of that angle; for 6D two columns that angle apart, that long. */
static void hard_make_turns(struct turns *t, bool six, double angle,
                            double length)
{
    struct random r;

    t->six = six;
    random_init(&r, 5, "bench turns");
    for (int i = 0; i < TURNS; i++) {
        double a[3], b[3], n = 0, m = 0;

        for (int k = 0; k < 3; k++) {
            a[k] = random_range(&r, -1, 1);
            b[k] = random_range(&r, -1, 1);
            n += a[k] * a[k];
            m += b[k] * b[k];
        }
        for (int k = 0; k < 3; k++) {
            double u = a[k] / sqrt(n);

            t->x[i][k] = (float)(six ? length * u : angle * u);
            t->x[i][3 + k] = (float)(length * (u + angle * b[k] / sqrt(m)));
        }
    }
}

/* Time of one kind, and its error against double. */
static int hard_rotation_row(struct bench *b, struct turns *t, const char *name,
                             double seconds, struct error *err)
{
    double *truth = malloc(TURNS * 9 * sizeof *truth), x[6], worst, psnr;
    struct bench_times m;
    int rc = truth ? 0 : error_set(err, EX_OSERR, "out of memory");

    if (rc == 0)
        rc = bench_time(&m, seconds, 20, hard_call_turns, t, err);
    for (int i = 0; i < TURNS && rc == 0; i++) {
        for (int k = 0; k < 6; k++)
            x[k] = t->x[i][k];
        if (t->six)
            rotation_6d_d(truth + 9 * i, x);
        else
            rotation_exp_d(truth + 9 * i, x);
    }
    if (rc == 0) {
        bench_compare(&worst, &psnr, t->R[0], truth, TURNS * 9);
        rc = hard_add(b, "rotation", "1,000 rotations", name, 1, &m, worst,
                      psnr, err);
    }
    free(truth);
    return rc;
}

/* Angles near nothing and near half a turn; 6D columns that nearly agree. */
static int hard_rotations(struct bench *b, double seconds, struct error *err)
{
    static const struct {
        const char *name;
        bool six;
        double angle, length;
    } cases[] = {{"axis-angle, 1 radian", false, 1, 0},
                 {"axis-angle of 1e-7", false, 1e-7, 0},
                 {"axis-angle of pi - 1e-6", false, 3.1415916535897931, 0},
                 {"6D, columns apart", true, 1, 1},
                 {"6D, columns 1e-3 apart", true, 1e-3, 1},
                 {"6D, columns 1e-6 long", true, 1, 1e-6}};
    struct turns *t = calloc(1, sizeof *t);
    int rc = t ? 0 : error_set(err, EX_OSERR, "out of memory");

    for (size_t i = 0; i < sizeof cases / sizeof *cases && rc == 0; i++) {
        hard_make_turns(t, cases[i].six, cases[i].angle, cases[i].length);
        rc = hard_rotation_row(b, t, cases[i].name, seconds, err);
    }
    free(t);
    return rc;
}

/* ---- the face crop ------------------------------------------------------ */

enum { SIDE = 512 };

struct cut {
    uint8_t *rgb;
    double *exact, *truth;
    float *out;
    struct square q;
};

/* Cut the square. */
static int hard_call_cut(void *context, struct error *err)
{
    struct cut *c = context;

    (void)err;
    crop_sample_u8(c->out, CROP_NET, c->rgb, SIDE, SIDE, 3 * SIDE, c->q);
    return 0;
}

/* Squares that are tiny, huge or outside the picture. */
static int hard_crops(struct bench *b, double seconds, struct error *err)
{
    static const struct {
        const char *name;
        struct square q;
    } cases[] = {{"inside", {256, 256, 300}},
                 {"half beyond the border", {0, 256, 300}},
                 {"a corner only", {-100, -100, 300}},
                 {"wholly outside", {-900, 256, 300}},
                 {"a face of 12 pixels", {256, 256, 12}},
                 {"larger than the picture", {256, 256, 1500}}};
    const size_t n = 3 * SIDE * SIDE, m = 3 * CROP_NET * CROP_NET;
    struct cut c = {malloc(n), malloc(n * sizeof(double)),
                    malloc(m * sizeof(double)), malloc(m * sizeof(float)),
                    {0, 0, 0}};
    struct bench_times t;
    struct random r;
    double worst, psnr;
    int rc = c.rgb && c.exact && c.truth && c.out
                 ? 0 : error_set(err, EX_OSERR, "out of memory");

    random_init(&r, 3, "bench hard crop");
    for (size_t i = 0; i < n && rc == 0; i++)
        c.exact[i] = (c.rgb[i] = (uint8_t)random_below(&r, 256)) / 255.0;
    for (size_t i = 0; i < sizeof cases / sizeof *cases && rc == 0; i++) {
        c.q = cases[i].q;
        rc = bench_time(&t, seconds, 20, hard_call_cut, &c, err);
        if (rc)
            break;
        crop_sample_ref(c.truth, CROP_NET, c.exact, SIDE, SIDE, c.q);
        bench_compare(&worst, &psnr, c.out, c.truth, m);
        rc = hard_add(b, "crop", "512x512 -> 224x224", cases[i].name, 1, &t,
                      worst, psnr, err);
    }
    free(c.rgb);
    free(c.exact);
    free(c.truth);
    free(c.out);
    return rc;
}

/* ---- the head ----------------------------------------------------------- */

struct pose_case {
    const char *name;
    double exp;                 /* every coefficient */
    double jaw, eye, lid;
};

struct posing {
    struct identity mean;
    struct head_motion m;
    float *verts;
};

/* Pose the head. */
static int hard_call_posing(void *context, struct error *err)
{
    struct posing *p = context;

    (void)err;
    head_pose(p->verts, &p->mean, &p->m);
    return 0;
}

/* Time of a pose, and its error against double. */
static int hard_pose_row(struct bench *b, struct posing *p,
                         const struct head *h, const struct pose_case *c,
                         double seconds, struct error *err)
{
    float exp[HEAD_MAX_EXP];
    double beta[HEAD_MAX_EXP] = {0}, wide[HEAD_MAX_EXP], worst, psnr;
    double *truth = malloc(3 * h->V * sizeof *truth);
    struct head_motion_d d = {.beta = beta, .exp = wide,
                              .lid = {c->lid, c->lid}};
    struct bench_times t;
    char config[64];
    int rc = truth ? 0 : error_set(err, EX_OSERR, "out of memory");

    memset(&p->m, 0, sizeof p->m);
    for (size_t k = 0; k < h->nexp; k++)
        wide[k] = exp[k] = (float)c->exp;
    p->m.exp = exp;
    d.pose[6] = p->m.jaw[0] = (float)c->jaw;
    for (int k = 0; k < 2; k++) {
        d.pose[9 + 3 * k] = p->m.eye[3 * k] = (float)c->eye;
        d.lid[k] = p->m.lid[k] = (float)c->lid;
    }
    if (rc == 0)
        rc = bench_time(&t, seconds, 50, hard_call_posing, p, err);
    if (rc == 0) {
        head_pose_d(truth, NULL, h, &d);
        bench_compare(&worst, &psnr, p->verts, truth, 3 * h->V);
        snprintf(config, sizeof config, "V=%zu, head units", h->V);
        rc = hard_add(b, "flame", config, c->name, 1, &t, worst, psnr, err);
    }
    free(truth);
    return rc;
}

/* At rest, lids closed, tiny and half turns, every expression at once. */
static int hard_poses(struct bench *b, double seconds, struct error *err)
{
    static const struct pose_case cases[] = {
        {"at rest (all weights zero)", 0, 0, 0, 0},
        {"lids closed", 0, 0, 0, 1},
        {"jaw turned by 1e-7", 0, 1e-7, 1e-7, 0},
        {"jaw turned by pi - 1e-6", 0, 3.1415916535897931, 0, 0},
        {"every expression at 3", 3, 0.3, 0.5, 0.5}};
    struct posing p = {0};
    struct head h;
    int rc;

    if (!b->head) {
        bench_note(b, "hard: no head.safetensors, poses left out");
        return 0;
    }
    if (head_load(&h, b->head, err))
        return -1;
    rc = h.nshape > HEAD_MAX_EXP ? 1 : head_fold(&p.mean, &h, NULL, 0, err);
    p.verts = malloc(3 * h.V * sizeof *p.verts);
    if (rc == 0 && !p.verts)
        rc = error_set(err, EX_OSERR, "out of memory");
    for (size_t i = 0; i < sizeof cases / sizeof *cases && rc == 0; i++)
        rc = hard_pose_row(b, &p, &h, &cases[i], seconds, err);
    identity_release(&p.mean);
    head_release(&h);
    free(p.verts);
    return rc < 0 ? -1 : 0;
}

/* ---- all ---------------------------------------------------------------- */

int bench_hard(struct bench *b, struct error *err)
{
    double part = b->seconds / 60;

    return hard_rotations(b, part, err) || hard_crops(b, part, err) ||
           hard_poses(b, part, err) ||
           bench_splat_hard(b, 2 * part, err) ? -1 : 0;
}
