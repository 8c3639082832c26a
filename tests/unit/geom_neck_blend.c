/* The neck blend of a head that shifts: shoulders stay where the source's
 * camera saw them while the way is short, and stay behind by a bounded length
 * where it is long. */
#include <math.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/base/camera.h"
#include "lib/base/drive.h"
#include "lib/base/neck_blend.h"
#include "lib/base/rotation.h"
#include "tests/check.h"

static const float pivot[3] = {0.02f, -0.7f, -0.15f};

/* A head turned by r (3) from upright, its pivot shifted by d (3) from where a
 * frontal camera sees it. */
static void neck_camera(float cam[12], const float r[3], const float d[3])
{
    float turn[9], R[9], t[3], at[3], upright[12];

    camera_frontal(upright, 12);
    rotation_exp(turn, r);
    mat3_mul(R, turn, neck_blend_upright);
    camera_apply(at, upright, pivot);
    for (int i = 0; i < 3; i++)
        t[i] = at[i] + d[i] - (R[3 * i] * pivot[0] + R[3 * i + 1] * pivot[1] +
                               R[3 * i + 2] * pivot[2]);
    camera_make(cam, R, t);
}

/* What moves: one static Gaussian that is all shoulders. */
static struct drive neck_drive(const float *x, const float *view)
{
    static const float whole = 1;
    struct drive d = {.mouth = 1, .mean = x, .weight = &whole, .view = view};

    memcpy(d.pivot, pivot, sizeof pivot);
    for (int i = 0; i < 9; i++)
        d.source[i] = view[4 * (i / 3) + i % 3];
    return d;
}

/* How far a shoulder is from where the source's camera saw it, before the
 * camera of a head turned by r and shifted by d. */
static double neck_off(const float r[3], const float shift[3])
{
    const float x[3] = {0.6f, -1.2f, -0.1f}, zero[3] = {0};
    float source[12], cam[12], y[3], was[3], now[3];
    struct drive_frame f;

    neck_camera(source, (float[3]){0.05f, -0.1f, 0.03f}, zero);
    neck_camera(cam, r, shift);
    const struct drive d = neck_drive(x, source);
    drive_bodies(&f, &d, cam);
    drive_static(y, &d, &f, 0, 1);
    camera_apply(was, source, x);
    camera_apply(now, cam, y);
    return hypot(hypot(now[0] - was[0], now[1] - was[1]), now[2] - was[2]);
}

static void test_turn(void)
{
    struct random r;
    double worst = 0;

    random_init(&r, 5, "neck");
    for (int k = 0; k < 50; k++) {
        float turn[3], none[3] = {0};

        for (int i = 0; i < 3; i++)
            turn[i] = (float)random_range(&r, -0.6, 0.6);
        worst = fmax(worst, neck_off(turn, none));
    }
    check("turns about the pivot: shoulders stay, head units", worst, 2e-5);
}

static void test_shift(void)
{
    const float still[3] = {0.1f, 0.2f, -0.1f};

    /* tanh(x) is x to x^3 / 3 */
    check("a shift of 2 mm: shoulders stay to 0.01 mm",
          neck_off(still, (float[3]){0.006f, -0.008f, 0}), 5e-5);
    check("a shift of 10 mm: they follow by less than 1 mm",
          neck_off(still, (float[3]){0.03f, 0, 0.04f}), 5e-3);
    check("a shift of 200 mm: they stay behind by 20 mm",
          fabs(neck_off(still, (float[3]){1, 0, 0}) -
               (1 - (double)NECK_BLEND_STAY)), 1e-4);
}

/* They never go back while the head goes on. */
static void test_order(void)
{
    const float still[3] = {0};
    double before = 0, back = 0;

    for (int k = 1; k <= 100; k++) {
        double off = neck_off(still, (float[3]){0.01f * (float)k, 0, 0});

        back = fmax(back, before - off);
        before = off;
    }
    check("shoulders follow without turning back", back, 1e-5);
}

int main(void)
{
    test_turn();
    test_shift();
    test_order();
    return check_status();
}
