/* The error of a shape against one computed from vertices in double, its
 * gradient against differences, and what a mirror does to a shape. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/base/rotation.h"
#include "lib/head/lbs.h"
#include "lib/head/mirror.h"
#include "lib/nn/params.h"
#include "lib/track/tta.h"
#include "lib/lab/train/shape_loss.h"
#include "tests/check.h"

enum { DIRS = 300, N = SHAPE_ENCODER_SIZE };

static void shape_die(const struct error *err)
{
    printf("%s\n", err->text);
    exit(1);
}

/* Vertices (V,3) of a shape in a neutral pose. */
static void shape_vertices(float *out, const struct head *h, const float *beta)
{
    struct identity id = {0};
    struct head_motion still = {0};
    struct error err;

    if (head_fold(&id, h, beta, h->nshape, &err))
        shape_die(&err);
    head_pose(out, &id, &still);
    identity_release(&id);
}

/* Root mean square of a - b (P,3) over coordinates when the best small move
 * and change of size of x (P,3) is taken from it: normal equations of each
 * unknown, which are independent about the mean. */
static double by_points(const float *a, const float *b, const float *x,
                        size_t P)
{
    double mean[3] = {0}, move[3] = {0}, grow = 0, size = 0, sum = 0;

    for (size_t i = 0; i < 3 * P; i++) {
        mean[i % 3] += (double)x[i] / (double)P;
        move[i % 3] += ((double)a[i] - b[i]) / (double)P;
    }
    for (size_t i = 0; i < 3 * P; i++) {
        double r = (double)x[i] - mean[i % 3];
        grow += r * ((double)a[i] - b[i]);
        size += r * r;
    }
    grow /= size;
    for (size_t i = 0; i < 3 * P; i++) {
        double e = (double)a[i] - b[i] - move[i % 3] -
                   grow * ((double)x[i] - mean[i % 3]);
        sum += e * e;
    }
    return sqrt(sum / (3.0 * (double)P));
}

static void shape_draw(float *beta, struct random *r)
{
    for (int k = 0; k < DIRS; k++)
        beta[k] = random_normal(r);
}

/* Two people: coefficients, vertices (V,3) and landmarks. */
struct two {
    float beta[DIRS], truth[DIRS], *a, *b, la[3 * 68], lb[3 * 68];
    struct shape_loss marks;
};

static void two_init(struct two *t, const struct head *h, uint64_t seed)
{
    struct random r;
    struct error err;

    t->a = malloc(3 * h->V * sizeof *t->a);
    t->b = malloc(3 * h->V * sizeof *t->b);
    if (!t->a || !t->b || shape_loss_init(&t->marks, h, DIRS, true, &err))
        exit(1);
    random_init(&r, seed, "two people");
    shape_draw(t->beta, &r);
    shape_draw(t->truth, &r);
    shape_vertices(t->a, h, t->beta);
    shape_vertices(t->b, h, t->truth);
    head_landmarks(t->la, h, t->a);
    head_landmarks(t->lb, h, t->b);
}

static void two_release(struct two *t)
{
    shape_loss_release(&t->marks);
    free(t->a);
    free(t->b);
}

static void test_value(const struct head *h)
{
    struct shape_loss all;
    struct two t;
    float lx[3 * 68], *beta = t.beta;
    struct error err;

    if (shape_loss_init(&all, h, DIRS, false, &err))
        shape_die(&err);
    two_init(&t, h, 3);
    double want = by_points(t.a, t.b, h->v_template, h->V);
    double got = shape_loss(NULL, beta, t.truth, &all);
    check("vertices' error, relative", fabs(got / want - 1), 1e-5);
    head_landmarks(lx, h, h->v_template);
    want = by_points(t.la, t.lb, lx, 68);
    got = shape_loss(NULL, beta, t.truth, &t.marks);
    check("landmarks' error, relative", fabs(got / want - 1), 1e-5);

    double g[DIRS], max = 0, step = 1e-3;
    got = shape_loss(g, beta, t.truth, &t.marks);
    for (int k = 0; k < DIRS; k += 7) {
        float keep = beta[k];
        beta[k] = keep + (float)step;
        double up = shape_loss(NULL, beta, t.truth, &t.marks);
        beta[k] = keep - (float)step;
        double down = shape_loss(NULL, beta, t.truth, &t.marks);
        beta[k] = keep;
        max = fmax(max, fabs((up - down) / (2 * step) - g[k]));
    }
    check("gradient by beta against differences", max / got, 1e-3);
    check("nothing is wrong with the truth",
          shape_loss(NULL, beta, beta, &all), 1.1e-6);
    shape_loss_release(&all);
    two_release(&t);
}

/* Size and place bring one face onto another as well as anything can, but for
 * the square of how much they differ. */
static void test_place(const struct head *h)
{
    struct shape_place place;
    struct two t;
    double size, x[3], sum = 0, plain = 0;
    struct error err;

    if (shape_place_init(&place, h, DIRS, &err))
        shape_die(&err);
    two_init(&t, h, 5);
    shape_place(&size, x, t.beta, t.truth, &place);
    for (int i = 0; i < 3 * 68; i++) {
        double e = t.la[i] - size * t.lb[i] - x[i % 3];
        double d = (double)t.la[i] - t.lb[i];
        sum += e * e / (3 * 68);
        plain += d * d / (3 * 68);
    }
    double best = shape_loss(NULL, t.beta, t.truth, &t.marks);
    check("size and place leave what shape_loss counts, relative",
          fabs(sqrt(sum) / best - 1), 0.05);
    check("which is less than before, share", best / sqrt(plain), 0.9);
    shape_place(&size, x, t.beta, t.beta, &place);
    check("a shape lies where it is", fabs(size - 1) + fabs(x[0]) +
          fabs(x[1]) + fabs(x[2]), 0);
    shape_place_release(&place);
    two_release(&t);
}

/* A mirrored shape has the mirrored vertices. */
static void test_mirror(const struct head *h, const int *mirror)
{
    struct head_mirror across;
    float beta[DIRS], other[DIRS];
    float *a = malloc(3 * h->V * sizeof *a), *b = malloc(3 * h->V * sizeof *b);
    double max = 0;
    size_t odd = 0;
    struct random r;
    struct error err;

    if (!a || !b || head_mirror_shape(&across, h, &err) != 1) {
        check_that("the built-in head has a mirror image", false);
        goto out;
    }
    random_init(&r, 4, "mirror");
    shape_draw(beta, &r);
    head_mirror_apply(other, beta, &across);
    for (int k = 0; k < DIRS; k++)
        odd += across.sign[k] < 0;
    shape_vertices(a, h, beta);
    shape_vertices(b, h, other);
    for (size_t v = 0; v < h->V; v++) {
        const float *p = a + 3 * v, *q = b + 3 * (size_t)mirror[v];
        max = fmax(max, fabs((double)p[0] + q[0]));
        max = fmax(max, fabs((double)p[1] - q[1]));
        max = fmax(max, fabs((double)p[2] - q[2]));
    }
    check("mirrored shape, mirrored vertices, head units", max, 1e-5);
    check("both kinds of directions", odd > 0 && odd < DIRS ? 0 : 1, 0);
out:
    free(a);
    free(b);
}

/* A lopsided direction leaves the head without signs. */
static void test_lopsided(const struct head *h)
{
    struct head bent = *h;
    struct head_mirror across;
    size_t n = h->blocks * h->nshape * 3 * HEAD_BLOCK;
    struct error err;

    bent.shape_dirs = malloc(n * sizeof *bent.shape_dirs);
    if (!bent.shape_dirs)
        exit(1);
    memcpy(bent.shape_dirs, h->shape_dirs, n * sizeof *bent.shape_dirs);
    for (size_t i = 0; i < 96; i++)     /* 32 vertices of one direction */
        bent.shape_dirs[5 * 96 + i] += 0.1f;
    check("a lopsided direction is seen",
          head_mirror_shape(&across, &bent, &err), 0);
    free(bent.shape_dirs);
}

static void shape_pose(float *verts, float R[9], const struct head *h,
                       const float *row)
{
    struct identity id = {0};
    struct head_motion m = {.exp = row + MOTION_EXP};
    struct error err;

    memcpy(m.jaw, row + MOTION_JAW, sizeof m.jaw);
    memcpy(m.lid, row + MOTION_LID, sizeof m.lid);
    memcpy(m.eye, row + MOTION_EYE, sizeof m.eye);
    if (head_fold(&id, h, NULL, 0, &err))
        shape_die(&err);
    head_pose(verts, &id, &m);
    identity_release(&id);
    rotation_6d(R, row + MOTION_ROT);
}

/* What E_m would say of the mirrored picture, read back, moves the head as the
 * first look does: the mean of a row and its mirror image is the row, and the
 * mirror image poses the mirrored head. */
static void test_motion(const struct head *h, const int *mirror)
{
    struct motion_mirror across;
    float a[MOTION_OUT], b[MOTION_OUT], mean[MOTION_OUT], Ra[9], Rb[9];
    float *x = malloc(3 * h->V * sizeof *x), *y = malloc(3 * h->V * sizeof *y);
    double square = 0, rotated = 0, back = 0;
    struct random r;
    struct error err;

    if (!x || !y || motion_mirror_init(&across, h, &err) != 1) {
        check_that("expressions have mirror images", false);
        goto out;
    }
    random_init(&r, 6, "motion");
    for (int k = 0; k < MOTION_OUT; k++)
        a[k] = 0.3f * random_normal(&r);
    for (int k = 0; k < 2; k++)
        a[MOTION_LID + k] = (float)random_uniform(&r);
    /* a jaw moves aside by a tenth of what it opens by */
    for (int k = 1; k < 3; k++)
        a[MOTION_JAW + k] *= 0.1f;
    for (int k = 0; k < MOTION_OUT; k++)
        b[k] = across.sign[k] * a[across.from[k]];
    shape_pose(x, Ra, h, a);
    shape_pose(y, Rb, h, b);
    for (size_t v = 0; v < h->V; v++) {
        const float *p = x + 3 * v, *q = y + 3 * (size_t)mirror[v];
        for (int c = 0; c < 3; c++) {
            double d = (double)p[c] + (c ? -q[c] : q[c]);
            square += d * d;
        }
    }
    for (int i = 0; i < 9; i++) {
        int odd = (i / 3 == 0) != (i % 3 == 0);
        rotated = fmax(rotated, fabs((double)Ra[i] - (odd ? -Rb[i] : Rb[i])));
    }
    memcpy(mean, a, sizeof mean);
    motion_mirror_mean(mean, b, &across);
    for (int k = 0; k < MOTION_OUT; k++)
        back = fmax(back, fabs((double)mean[k] - a[k]));
    /* some of the scans' expressions are symmetric only to a cosine of 0.98 */
    check("mirrored motion, mirrored vertices, mm rms",
          sqrt(square / (double)h->V) / (double)h->scale * 1e3, 0.5);
    check("mirrored rotation", rotated, 1e-5);
    check("the mean of a row and its mirror image", back, 1e-7);
out:
    free(x);
    free(y);
}

/* A picture of N pixels that may be mirrored, brighter to one side. */
static int shape_look(void *ctx, float *rgb, struct square q, struct error *err)
{
    int flip = *(int *)ctx;

    (void)err;
    for (size_t y = 0; y < N; y++)
        for (size_t x = 0; x < N; x++) {
            double u = q.x + q.size * (((double)x + 0.5) / N - 0.5);
            double v = q.y + q.size * (((double)y + 0.5) / N - 0.5);

            u = flip ? -u : u;
            for (int c = 0; c < 3; c++)
                rgb[3 * (y * N + x) + (size_t)c] = (float)
                    (0.5 + 0.3 * sin(7 * u + c) * cos(5 * v) + 0.1 * u);
        }
    return 0;
}

/* The shape seen in a mirrored picture is the mirrored shape. */
static void test_looks(const struct head *h)
{
    struct params ps;
    struct shape_encoder net;
    struct shape_tta l;
    struct nn_options opt = {NN_INFER, NN_F32};
    struct square q = {0, 0, 1};
    float a[SHAPE_ENCODER_OUT], b[SHAPE_ENCODER_OUT];
    double max = 0, size = 0;
    int flip = 0;
    struct error err;

    params_init(&ps);
    if (shape_encoder_init(&net, &ps, "shape.", "mobilenetv3_small_100",
                           &err) || params_allocate(&ps, &err))
        shape_die(&err);
    params_randomise(&ps, 9);
    if (shape_encoder_plan(&net, 1, opt, &err) ||
        shape_tta_init(&l, &net, h, &err) ||
        shape_tta_forward(a, &l, q, shape_look, &flip, &err))
        shape_die(&err);
    flip = 1;
    if (shape_tta_forward(b, &l, q, shape_look, &flip, &err))
        shape_die(&err);
    for (int k = 0; k < SHAPE_ENCODER_OUT; k++) {
        max = fmax(max, fabs((double)a[k] - l.across.sign[k] *
                                              b[l.across.from[k]]));
        size = fmax(size, fabs((double)a[k]));
    }
    check("mirrored picture, mirrored shape, relative", max / size, 1e-3);
    shape_tta_release(&l);
    shape_encoder_release(&net);
    params_release(&ps);
}

/* The vertex at (-x, y, z), by looking at all of them. */
static void shape_mirror(int *mirror, const struct head *h)
{
    for (size_t v = 0; v < h->V; v++) {
        const float *p = h->v_template + 3 * v;
        double best = INFINITY;

        for (size_t w = 0; w < h->V; w++) {
            const float *q = h->v_template + 3 * w;
            double far = hypot(hypot(p[0] + q[0], p[1] - q[1]), p[2] - q[2]);

            if (far < best) {
                best = far;
                mirror[v] = (int)w;
            }
        }
    }
}

int main(void)
{
    struct head h;
    int *mirror;
    struct error err = {0};

    if (head_load(&h, "examples/model/head.safetensors", &err))
        shape_die(&err);
    if (!(mirror = malloc(h.V * sizeof *mirror)))
        return 1;
    shape_mirror(mirror, &h);
    test_value(&h);
    test_place(&h);
    test_mirror(&h, mirror);
    test_lopsided(&h);
    test_motion(&h, mirror);
    test_looks(&h);
    free(mirror);
    head_release(&h);
    return check_status();
}
