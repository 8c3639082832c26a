/* Hair before a wall, dark before white and light before dark, with locks that
 * hang away from the head: when the person moves, neither a ghost of them
 * stays on the wall nor does a rim of the wall go with them.  And the same cut
 * out by the wall's colour. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "formats/layers.h"
#include "formats/matte.h"
#include "lib/base/random.h"
#include "tests/check.h"

enum { N = 256, LOCKS = 6 };

struct palette {
    const char *name;
    double wall[3], hair[3];
};

struct drawing {
    uint8_t rgb[3 * N * N], head[N * N], inside[N * N];
    double person[N * N], own[3 * N * N];
};

static double hair_ellipse(double x, double y, double cx, double cy, double rx,
                           double ry)
{
    return (1 - hypot((x - cx) / rx, (y - cy) / ry)) * fmin(rx, ry);
}

static double hair_cover(double depth)
{
    return fmin(1, fmax(0, depth + 0.5));
}

/* How much of a pixel locks cover: curves a pixel and a half wide that leave
 * the head to both sides and hang down. */
static double hair_locks(double x, double y)
{
    double most = 0;

    for (int k = 0; k < LOCKS; k++) {
        double side = k % 2 ? 1 : -1, out = 10 + 4 * k;

        for (double t = 0; t <= 1; t += 0.01) {
            double lx = 127 + side * (38 + out * sin(2.2 * t));
            double ly = 110 + 10 * (k / 2) + 45 * t;
            most = fmax(most, hair_cover(0.9 - hypot(x - lx, y - ly)));
        }
    }
    return most;
}

static void hair_draw(struct drawing *d, const struct palette *p)
{
    static const double skin[3] = {205, 150, 125}, shirt[3] = {120, 60, 60};
    struct random r;

    random_init(&r, 4, p->name);
    memset(d->inside, 255, sizeof d->inside);
    for (int y = 0; y < N; y++)
        for (int x = 0; x < N; x++) {
            int i = y * N + x;
            double head = hair_ellipse(x, y, 127, 112, 46, 56);
            double body = hair_ellipse(x, y, 127, 240, 84, 70);
            double face = hair_cover(hair_ellipse(x, y, 127, 124, 34, 42));
            double lock = fmax(hair_cover(head), hair_locks(x, y));
            double a = fmax(lock, hair_cover(body));
            double noise = 3 * random_normal(&r);

            for (int k = 0; k < 3; k++) {
                double own = lock > 0 ? p->hair[k] : shirt[k];

                own += face * (skin[k] - own);
                d->own[3 * i + k] = own;
                d->rgb[3 * i + k] = (uint8_t)fmin(255, fmax(0,
                    a * own + (1 - a) * p->wall[k] + noise));
            }
            d->person[i] = a;
            d->head[i] = hair_ellipse(x, y, 127, 122, 36, 46) > 0 ? 255 : 0;
        }
}

/* Of the wall as it is taken to be, the share of those pixels that a person
 * with thin hair hides or touches that is off by more than 12 levels. */
static double hair_ghost(const uint8_t *back, const struct drawing *d,
                         const struct palette *p)
{
    double off = 0, n = 0;

    for (size_t i = 0; i < N * N; i++) {
        double most = 0;

        for (size_t k = 0; k < 3; k++)
            most = fmax(most, fabs(back[3 * i + k] - p->wall[k]));
        off += d->person[i] > 0.1 && most > 12;
        n += d->person[i] > 0.1;
    }
    return off / n;
}

/* The person laid over another wall: mean distance from how that would look,
 * in levels, over the pixels at the edge. */
static double hair_halo(const uint8_t *rgb, const uint8_t *matte,
                        const uint8_t *back, const struct drawing *d,
                        const double wall[3])
{
    double sum = 0, n = 0;

    for (size_t i = 0; i < N * N; i++) {
        if (d->person[i] <= 0.02 || d->person[i] >= 0.98)
            continue;
        double m = matte[i] / 255.0, a = d->person[i];
        for (size_t k = 0; k < 3; k++) {
            double p = fmax(0, rgb[3 * i + k] - (1 - m) * back[3 * i + k]);
            double got = p + (1 - m) * wall[k];

            sum += fabs(got - a * d->own[3 * i + k] - (1 - a) * wall[k]) / 3;
        }
        n++;
    }
    return sum / n;
}

static const struct palette palette[2] = {
    {"dark hair, white wall", {235, 236, 238}, {40, 28, 22}},
    {"light hair, dark wall", {38, 42, 50}, {214, 182, 128}}
};

/* By the wall's colour, which falls off to one side; and refused where the
 * surroundings are no wall. */
static void hair_test_wall(void)
{
    static struct drawing d;
    static uint8_t matte[N * N];
    struct error err = {0};
    struct random r;
    bool plain;

    for (int k = 0; k < 2; k++) {
        double error = 0;
        char text[80];

        hair_draw(&d, &palette[k]);
        for (size_t i = 160 * N; i < 190 * N; i++)  /* with a neck */
            if (i % N > 110 && i % N < 145) {
                d.person[i] = 1;
                memset(d.rgb + 3 * i, 130, 3);
            }
        for (size_t i = 0; i < N * N; i++) {
            double dim = (1 - d.person[i]) * (double)(i % N) / N * 25;
            for (size_t c = 0; c < 3; c++)
                d.rgb[3 * i + c] = (uint8_t)fmax(0, d.rgb[3 * i + c] - dim);
        }
        REQUIRE(!matte_wall(matte, &plain, d.rgb, d.head, d.inside, N, &err),
                "%s", err.text);
        snprintf(text, sizeof text, "%s: a plain wall", palette[k].name);
        check_that(text, plain);
        for (size_t i = 0; i < N * N; i++)
            error += fabs(matte[i] / 255.0 - d.person[i]) / (N * N);
        snprintf(text, sizeof text, "%s: keyed, mean error", palette[k].name);
        check(text, error, 0.006);
    }
    random_init(&r, 5, "no wall");
    for (size_t i = 0; i < sizeof d.rgb; i++)
        d.rgb[i] = (uint8_t)random_below(&r, 256);
    REQUIRE(!matte_wall(matte, &plain, d.rgb, d.head, d.inside, N, &err), "%s",
            err.text);
    check_that("noise is no plain wall", !plain);
    memset(d.head, 0, sizeof d.head);
    REQUIRE(!matte_wall(matte, &plain, d.rgb, d.head, d.inside, N, &err), "%s",
            err.text);
    check_that("without a head there is nobody to cut out", !plain);
}

/* An ear beside dark hair that a matte took for a fifth of what it is, of a
 * colour that is no mixture of hair and wall: it does not stay on the wall, and
 * the two layers are the picture still. */
static void hair_test_ear(void)
{
    static uint8_t rgb[3 * N * N], matte[N * N], back[3 * N * N];
    static uint8_t inside[N * N];
    const uint8_t colour[3][3] = {{110, 140, 135}, {30, 22, 20},
                                  {214, 150, 120}};
    struct error err = {0};
    double ghost = 0, sum = 0;

    memset(inside, 255, sizeof inside);
    for (size_t i = 0; i < N * N; i++) {
        const double x = (double)(i % N), y = (double)(i / N);
        const int what = hair_ellipse(x, y, 128, 128, 50, 70) > 0 ? 1
                         : hair_ellipse(x, y, 179, 128, 4, 8) > 0 ? 2 : 0;

        memcpy(rgb + 3 * i, colour[what], 3);
        matte[i] = what == 1 ? 255 : what == 2 ? 51 : 0;
    }
    REQUIRE(layers_split(matte, back, rgb, inside, N, &err) == 0, "%s",
            err.text);
    for (size_t i = 0; i < N * N; i++)
        for (size_t c = 0; c < 3; c++) {
            const double b = back[3 * i + c], hidden = (255 - matte[i]) * b;

            ghost = fmax(ghost, fabs(b - colour[0][c]));
            sum = fmax(sum, fmax(rgb[3 * i + c] - hidden / 255 - matte[i],
                                 hidden / 255 - rgb[3 * i + c]));
        }
    check("an ear that is taken for less: levels on the wall", ghost, 18);
    check("and levels by which both layers miss the picture", sum, 1.01);
}

int main(void)
{
    static struct drawing d;
    static uint8_t matte[N * N], back[3 * N * N], rgb[3 * N * N];

    for (int k = 0; k < 2; k++) {
        struct error err = {0};
        bool fallback;
        char text[80];

        hair_draw(&d, &palette[k]);
        memcpy(rgb, d.rgb, sizeof rgb);
        REQUIRE(matte_grabcut(matte, &fallback, rgb, d.head, d.inside, N,
                              &err) == 0, "%s", err.text);
        REQUIRE(layers_split(matte, back, rgb, d.inside, N, &err) == 0, "%s",
                err.text);
        snprintf(text, sizeof text, "%s: ghost, share of pixels",
                 palette[k].name);
        check(text, hair_ghost(back, &d, &palette[k]), 0.015);
        snprintf(text, sizeof text, "%s: halo, levels", palette[k].name);
        check(text, hair_halo(rgb, matte, back, &d, palette[1 - k].wall), 25);
    }
    hair_test_wall();
    hair_test_ear();
    return check_status();
}
