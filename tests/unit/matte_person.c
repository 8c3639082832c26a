/* The matte of a drawn person (skin, dark hair, a shirt) before a bright wall,
 * in a picture smaller than its square: GrabCut finds him, learns nothing from
 * the black about the picture, and his layer has the soft rim's colours without
 * the wall's, and is unchanged elsewhere: not a striped shirt where the
 * picture ends in black.  A picture with nothing in it but the face gets the
 * disc. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/layers.h"
#include "formats/matte.h"
#include "lib/base/random.h"
#include "lib/photo/texture.h"
#include "tests/check.h"

enum { N = 256, LEFT = 56, TOP = 48, RIGHT = 198, BOTTOM = 204 };

/* How far (x,y) is inside an ellipse, in pixels, about. */
static double person_inside(double x, double y, double cx, double cy, double rx,
                            double ry)
{
    return (1 - hypot((x - cx) / rx, (y - cy) / ry)) * fmin(rx, ry);
}

static double person_cover(double depth, double soft)
{
    return fmin(1, fmax(0, depth / soft + 0.5));
}

static void person_over(double c[3], const double paint[3], double a)
{
    for (int k = 0; k < 3; k++)
        c[k] = paint[k] * a + c[k] * (1 - a);
}

struct drawing {
    uint8_t rgb[3 * N * N], pure[3 * N * N], head[N * N], picture[N * N];
    double person[N * N];
};

/* rgb, and pure: the person's colours without the wall's share. */
static void person_draw(struct drawing *d, int striped)
{
    static const double wall[3] = {188, 200, 208}, hair[3] = {70, 45, 30};
    static const double skin[3] = {205, 150, 125}, shirt[3] = {60, 80, 110};
    static const double stripe[3] = {14, 14, 16};
    struct random r;

    random_init(&r, 4, "matte");
    memset(d, 0, sizeof *d);
    for (int y = TOP; y < BOTTOM; y++)
        for (int x = LEFT; x < RIGHT; x++) {
            int i = y * N + x;
            double h = person_inside(x, y, 127, 112, 46, 56);
            double s = person_inside(x, y, 127, 220, 84, 64);
            double a = fmax(person_cover(h, 4), person_cover(s, 4)), c[3], p[3];
            double n = 4 * random_normal(&r);

            memcpy(p, h > s ? hair : striped && y / 3 % 2 ? stripe : shirt,
                   sizeof p);
            person_over(p, skin,
                        person_cover(person_inside(x, y, 127, 124, 34, 42), 2));
            memcpy(c, wall, sizeof c);
            person_over(c, p, a);
            for (int k = 0; k < 3; k++) {
                d->rgb[3 * i + k] = (uint8_t)fmin(255, fmax(0, c[k] + n));
                d->pure[3 * i + k] = (uint8_t)fmin(255, fmax(0, p[k] + n));
            }
            d->person[i] = a;
            d->head[i] = person_inside(x, y, 127, 122, 36, 46) > 0 ? 255 : 0;
            d->picture[i] = 255;
        }
}

/* Mean distance of rgb from the person's own colours where his share lies
 * between the two, in levels. */
static double person_impurity(const uint8_t *rgb, const struct drawing *d,
                              double lo, double hi)
{
    double sum = 0;
    size_t n = 0;

    for (size_t i = 0; i < N * N; i++)
        if (d->person[i] >= lo && d->person[i] <= hi) {
            for (size_t k = 3 * i; k < 3 * i + 3; k++)
                sum += abs(rgb[k] - d->pure[k]) / 3.0;
            n++;
        }
    return sum / (double)(n ? n : 1);
}

/* The part of the person's own pixels that the matte leaves out. */
static double person_missed(const uint8_t *matte, const struct drawing *d)
{
    double out = 0, all = 0;

    for (size_t i = 0; i < N * N; i++) {
        all += d->person[i] >= 1;
        out += d->person[i] >= 1 && matte[i] < 230;
    }
    return out / all;
}

/* Largest distance of person + (1 - matte) back from the picture, levels. */
static double person_imbalance(const uint8_t *rgb, const uint8_t *matte,
                               const uint8_t *back, const uint8_t *inside)
{
    static uint8_t own[3 * N * N];
    double most = 0;

    texture_straight(own, rgb, matte, back, N * N);
    for (size_t i = 0; i < 3 * N * N; i++) {
        double m = matte[i / 3] / 255.0;
        double sum = m * own[i] + (1 - m) * back[i];

        if (inside[i / 3])
            most = fmax(most, fabs(sum - rgb[i]));
    }
    return most;
}

/* Mean distance of the background from the wall where the person hid it. */
static double person_ghost(const uint8_t *back, const struct drawing *d)
{
    static const double wall[3] = {188, 200, 208};
    double sum = 0;
    size_t n = 0;

    for (size_t i = 0; i < N * N; i++)
        if (d->person[i] > 0.05 && d->picture[i]) {
            for (size_t c = 0; c < 3; c++)
                sum += fabs(back[3 * i + c] - wall[c]) / 3;
            n++;
        }
    return sum / (double)n;
}

/* rgb: the person's own colours as found. */
static void person_find(uint8_t *matte, uint8_t *rgb, const struct drawing *d)
{
    static uint8_t back[3 * N * N], picture[3 * N * N];
    struct error err = {0};
    bool fallback;
    double before;

    memcpy(picture, d->rgb, sizeof picture);
    if (matte_grabcut(matte, &fallback, picture, d->head, d->picture, N,
                      &err)) {
        printf("%s\n", err.text);
        exit(1);
    }
    before = person_missed(matte, d);
    if (layers_split(matte, back, picture, d->picture, N, &err)) {
        printf("%s\n", err.text);
        exit(1);
    }
    texture_straight(rgb, picture, matte, back, N * N);
    check("the colours decide", fallback, 0);
    check("unmixing takes nothing from the person",
          person_missed(matte, d) - before, 0.001);
    check("his own colours stay", person_impurity(rgb, d, 1, 1), 0.5);
    check("the layers make the picture again, levels",
          person_imbalance(picture, matte, back, d->picture), 2);
    check("no ghost of the person behind him, levels", person_ghost(back, d),
          5);
}

static void only_the_face(const struct drawing *whole)
{
    static struct drawing d;
    static uint8_t matte[N * N];
    struct error err = {0};
    bool fallback = false;
    int rc;

    d = *whole;
    for (int i = 0; i < N * N; i++)
        if (abs(i % N - 127) > 28 || abs(i / N - 122) > 32) {
            memset(d.rgb + 3 * i, 0, 3);
            d.picture[i] = 0;
        }
    rc = matte_grabcut(matte, &fallback, d.rgb, d.head, d.picture, N, &err);
    check_that("nothing but a face: the disc", rc == 0 && fallback);
}

int main(void)
{
    static struct drawing d;
    static uint8_t matte[N * N], rgb[3 * N * N];
    double both = 0, any = 0, beyond = 0, before, after;

    person_draw(&d, 0);
    person_find(matte, rgb, &d);
    for (size_t i = 0; i < N * N; i++) {
        int a = matte[i] > 127, b = d.person[i] > 0.5;
        both += a && b;
        any += a || b;
        beyond += !d.picture[i] && matte[i];
    }
    check_range("matte and person: intersection over union", both / any,
                0.95, 1);
    check("pixels of the matte outside of the picture", beyond, 0);
    before = person_impurity(d.rgb, &d, 0.5, 0.95);
    after = person_impurity(rgb, &d, 0.5, 0.95);
    check_range("the rim's colours are mixed, levels", before, 10, 255);
    check("less so after unmixing, levels", after, 0.5 * before);
    only_the_face(&d);
    person_draw(&d, 1);
    person_find(matte, rgb, &d);
    return check_status();
}
