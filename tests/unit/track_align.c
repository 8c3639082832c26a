/* Photometric alignment on pictures that are exact: an ellipsoid with waves
 * on it, seen by a known camera.  Poses are given with E_m's errors and have to
 * come back with a fraction of them. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/base/camera.h"
#include "lib/base/rotation.h"
#include "lib/track/align.h"
#include "tests/check.h"
#include "tests/unit/camera_double.h"
#include "tests/unit/sphere_head.h"

#define SIZE 512                /* of the portrait window */
#define FRAMES 24

static const struct square crop = {256, 256, 360};
static const struct align_bounds whole = {0, 0, 1, 1};

/* Level of the head at x, 0 to 1. */
static double align_paint(const double x[3])
{
    return 0.5 + 0.1 * sin(14 * x[0] + 1) + 0.1 * sin(11 * x[1] + 9 * x[0]) +
           0.1 * sin(13 * x[2] - 12 * x[1]) + 0.08 * sin(23 * x[0] + 2);
}

/* rgb (224,224,3) = the ellipsoid through camera m, its light changed. */
static void align_render(float *rgb, const struct motion *m, double gain,
                         double bias)
{
    static const double axis[3] = {0.4, 0.55, 0.45};
    float cam[12], o[3], d[3];

    camera_make(cam, m->R, m->t);
    camera_origin(o, cam);
    for (size_t i = 0; i < CROP_NET * CROP_NET; i++) {
        double u[2] = {(double)(i % CROP_NET), (double)(i / CROP_NET)};
        double a = 0, b = 0, c = -1, level = 0.3;

        for (int k = 0; k < 2; k++)
            u[k] = 256 + ((u[k] + 0.5) / CROP_NET - 0.5) * crop.size;
        camera_ray(d, cam, SIZE, (float)u[0], (float)u[1]);
        for (int k = 0; k < 3; k++) {
            a += d[k] / axis[k] * d[k] / axis[k];
            b += d[k] / axis[k] * o[k] / axis[k];
            c += o[k] / axis[k] * o[k] / axis[k];
        }
        if (b * b > a * c) {
            double s = (-b - sqrt(b * b - a * c)) / a, x[3];

            for (int k = 0; k < 3; k++)
                x[k] = o[k] + s * d[k];
            level = align_paint(x);
        }
        for (size_t k = 0; k < 3; k++)
            rgb[3 * i + k] = (float)(gain * level + bias);
    }
}

/* The frontal head turned by r (radians) and moved. */
static void align_place(struct motion *m, const float r[3], float x, float y,
                        float z)
{
    static const float front[9] = {1, 0, 0, 0, -1, 0, 0, 0, -1};
    float turn[9];

    memset(m, 0, sizeof *m);
    rotation_exp(turn, r);
    mat3_mul(m->R, turn, front);
    m->t[0] = x;
    m->t[1] = y;
    m->t[2] = z;
}

/* A slow turn and sway, so large: frame i's true pose. */
static void align_truth(struct motion *m, size_t i, double large)
{
    const double a = (double)i / FRAMES;
    const float r[3] = {(float)(large * 0.05 * sin(5 * a)),
                        (float)(large * 0.25 * sin(3 * a)),
                        (float)(large * 0.08 * sin(4 * a))};

    align_place(m, r, (float)(large * 0.03 * sin(6 * a)),
                (float)(large * 0.02 * sin(7 * a)),
                (float)(11 + large * 0.4 * sin(2 * a)));
}

/* m with an error as E_m's are. */
static void align_disturb(struct motion *m, struct random *rand)
{
    float r[3], turn[9], R[9];

    for (int k = 0; k < 3; k++)
        r[k] = (float)(0.01 * random_normal(rand));
    rotation_exp(turn, r);
    mat3_mul(R, turn, m->R);
    memcpy(m->R, R, sizeof R);
    m->t[0] += (float)(0.008 * random_normal(rand));
    m->t[1] += (float)(0.008 * random_normal(rand));
    m->t[2] += (float)(0.08 * random_normal(rand));
}

/* Errors of a pose: radians, and pixels of the head's middle. */
static void align_errors(double e[2], const struct motion *m,
                         const struct motion *truth)
{
    const double f = camera_focal(SIZE);

    e[0] += rotation_distance(m->R, truth->R);
    e[1] += f * hypot((double)m->t[0] / m->t[2] -
                      (double)truth->t[0] / truth->t[2],
                      (double)m->t[1] / m->t[2] -
                      (double)truth->t[1] / truth->t[2]);
}

/* Sums of the errors, given and aligned, over frames of a motion so large
 * whose light changes, too; returns how many keyframes it took. */
static size_t align_run(double given[2], double aligned[2], double large,
                        const struct identity *id, float *rgb)
{
    struct align a;
    struct random rand;
    struct error err = {0};
    size_t keys;

    random_init(&rand, 1, "align");
    REQUIRE(align_init(&a, id, &err) == 0, "%s", err.text);
    for (size_t i = 0; i < FRAMES; i++) {
        struct motion truth, m;
        bool laid;

        align_truth(&truth, i, large);
        m = truth;
        if (i > 0)
            align_disturb(&m, &rand);
        align_errors(given, &m, &truth);
        align_render(rgb, &truth, 1 - 0.004 * (double)i,
                     0.002 * (double)i);
        laid = align_step(&a, &m, rgb, crop, whole, SIZE);
        CHECK(laid, "frame %zu could not be laid over anything", i);
        align_errors(aligned, &m, &truth);
    }
    keys = a.keys;
    align_release(&a);
    return keys;
}

static void test_poses(const struct identity *id, float *rgb)
{
    double given[2] = {0}, small[2] = {0}, large[2] = {0}, again[2] = {0};
    double still[2] = {0};

    align_run(given, still, 0, id, rgb);
    check("a head that keeps still: turns, of the given error",
          still[0] / given[0], 0.02);
    check("its places, of the given error", still[1] / given[1], 0.011);
    memset(given, 0, sizeof given);
    check_range("keyframes of a swaying head",
                (double)align_run(given, small, 0.2, id, rgb), 1, 1);
    check("its turns, of the given error", small[0] / given[0], 0.4);
    check("its places, of the given error", small[1] / given[1], 0.25);
    memset(given, 0, sizeof given);
    check_range("keyframes for 14 degrees of turning",
                (double)align_run(given, large, 1, id, rgb), 2, 10);
    check("its turns, of the given error", large[0] / given[0], 0.7);
    check("its places, of the given error", large[1] / given[1], 0.5);
    align_run(given, again, 1, id, rgb);
    check("the same again",
          fabs(large[0] - again[0]) + fabs(large[1] - again[1]), 0);
}

/* Frame i of a head that comes nearer while it looks from side to side: more
 * poses than keyframes. */
static void align_wander(struct motion *m, size_t i)
{
    const float r[3] = {0, (float)(0.4 * sin(0.15 * (double)i)), 0};

    align_place(m, r, 0, 0, 18 - 0.018f * (float)i);
}

/* off = R R_true^T: the error of a pose's turn. */
static void align_turn_off(float off[9], const struct motion *m,
                           const struct motion *truth)
{
    float back[9];

    for (int k = 0; k < 9; k++)
        back[k] = truth->R[k % 3 * 3 + k / 3];
    mat3_mul(off, m->R, back);
}

/* How far the pose is from the nearest keyframe: radians, and the logarithm of
 * the depths' ratio. */
static double align_nearest(const struct align *a, const struct motion *m)
{
    double min = INFINITY;

    for (size_t k = 0; k < a->keys; k++)
        min = fmin(min, rotation_distance(a->key[k].R, m->R) +
                                fabs(log((double)a->key[k].t[2] / m->t[2])));
    return min;
}

/* When there are as many keyframes as there may be, later poses still get one;
 * far from all of them the head would tremble as E_m's poses do. */
static void test_many_keyframes(const struct identity *id, float *rgb)
{
    struct align a;
    struct random rand;
    struct error err = {0};
    double given = 0, aligned = 0, nearest = 0;
    float was[2][9], off[2][9];
    size_t full = 0;

    random_init(&rand, 3, "align");
    REQUIRE(align_init(&a, id, &err) == 0, "%s", err.text);
    for (size_t i = 0; i < 500; i++) {
        struct motion truth, m;

        align_wander(&truth, i);
        m = truth;
        if (i > 0)
            align_disturb(&m, &rand);
        align_turn_off(off[0], &m, &truth);
        align_render(rgb, &truth, 1, 0);
        CHECK(align_step(&a, &m, rgb, crop, whole, SIZE),
              "frame %zu could not be laid over anything", i);
        align_turn_off(off[1], &m, &truth);
        full += a.keys == ALIGN_KEYFRAMES;
        if (full > 1) {
            given += rotation_distance(off[0], was[0]);
            aligned += rotation_distance(off[1], was[1]);
            nearest = fmax(nearest, align_nearest(&a, &truth));
        }
        memcpy(was, off, sizeof was);
    }
    check_range("frames with all keyframes", (double)full, 120, 499);
    check_range("keyframes there are", (double)a.keys, ALIGN_KEYFRAMES,
                ALIGN_KEYFRAMES);
    check("a pose from its nearest keyframe", nearest, 0.2);
    check("trembling, of the given", aligned / given, 0.3);
    align_release(&a);
}

/* Another picture: the pose is left alone, and after some such the keyframes
 * are given up. */
static void test_strange_picture(const struct identity *id, float *rgb)
{
    static const float none[3] = {0};
    struct align a;
    struct random rand;
    struct motion m, before;
    struct error err = {0};
    int refused = 0;

    random_init(&rand, 2, "align");
    REQUIRE(align_init(&a, id, &err) == 0, "%s", err.text);
    align_place(&m, none, 0, 0, 11);
    before = m;
    align_render(rgb, &m, 1, 0);
    check_that("the first frame is a keyframe",
               align_step(&a, &m, rgb, crop, whole, SIZE) && a.keys == 1);
    check_that("and stays where it is", !memcmp(&m, &before, sizeof m));
    for (size_t i = 0; i < 3 * CROP_NET * CROP_NET; i++)
        rgb[i] = (float)random_uniform(&rand);
    while (a.keys && refused < 100)
        refused += !align_step(&a, &m, rgb, crop, whole, SIZE);
    check_range("strange frames until the keyframes go", refused, 2, 50);
    check_that("none of them moved the pose", !memcmp(&m, &before, sizeof m));
    memset(rgb, 0, 3 * CROP_NET * CROP_NET * sizeof *rgb);
    align_step(&a, &m, rgb, crop, whole, SIZE);
    align_step(&a, &m, rgb, crop, whole, SIZE);
    check_that("blank frames leave it, too", !memcmp(&m, &before, sizeof m));
    align_release(&a);
}

/* A picture that ends in the middle of the crop. */
static void test_border(const struct identity *id, float *rgb)
{
    const struct align_bounds left_half = {0, 0, 0.5, 1};
    static const float turn[3] = {0, 0.03f, 0};
    static const float none[3] = {0};
    struct align a;
    struct motion m, truth;
    struct error err = {0};
    double e[2] = {0};

    REQUIRE(align_init(&a, id, &err) == 0, "%s", err.text);
    for (int i = 0; i < 2; i++) {
        align_place(&truth, i ? turn : none, 0, 0, 11);
        m = truth;
        m.t[0] += i ? 0.01f : 0;
        align_render(rgb, &truth, 1, 0);
        for (size_t p = 0; p < CROP_NET * CROP_NET; p++)
            if (p % CROP_NET >= CROP_NET / 2)
                rgb[3 * p] = rgb[3 * p + 1] = rgb[3 * p + 2] = 0;
        align_step(&a, &m, rgb, crop, left_half, SIZE);
    }
    align_errors(e, &m, &truth);
    check("half a picture: pixels off, of 2.8", e[1], 0.9);
    align_release(&a);
}

int main(void)
{
    float *rgb = malloc(3 * CROP_NET * CROP_NET * sizeof *rgb);
    const float beta[2] = {0};
    struct head h;
    struct identity id;
    struct error err = {0};

    sphere_head(&h, 48, 64);
    REQUIRE(rgb && head_fold(&id, &h, beta, 2, &err) == 0, "%s", err.text);
    test_poses(&id, rgb);
    test_many_keyframes(&id, rgb);
    test_strange_picture(&id, rgb);
    test_border(&id, rgb);
    identity_release(&id);
    head_release(&h);
    free(rgb);
    return check_status();
}
