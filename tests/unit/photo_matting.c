/* A person cut out of drawn pictures whose truth is known: hair with locks that
 * hang away from the head, dark before white and light before dark, a soft
 * edge, a patterned wall, a striped one behind the person, somebody small, a picture
 * that ends, and pieces apart from the head. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/parallel.h"
#include "lib/base/random.h"
#include "lib/photo/margin.h"
#include "lib/photo/matte.h"
#include "tests/check.h"

enum { N = 256, P = N * N, LOCKS = 6 };

struct palette {
    const char *name;
    double wall[3], hair[3];
};

static const struct palette palette[2] = {
    {"dark hair, white wall", {235, 236, 238}, {40, 28, 22}},
    {"light hair, dark wall", {38, 42, 50}, {214, 182, 128}}
};

/* A picture, its truth, and what is found. */
static struct drawing {
    uint8_t rgb[3 * P], head[P];
    struct extent inside;
    double person[P], own[3 * P], wall[3 * P];
    uint8_t alpha[P], confidence[P], back[3 * P];
} d;

static bool is_inside(size_t i)
{
    return extent_has(&d.inside, i % N, i / N);
}

static double depth(double x, double y, double cx, double cy, double rx,
                    double ry)
{
    return (1 - hypot((x - cx) / rx, (y - cy) / ry)) * fmin(rx, ry);
}

static double cover(double deep)
{
    return fmin(1, fmax(0, deep + 0.5));
}

/* How much of a pixel locks cover: curves a pixel and a half wide that leave
 * the head to both sides and hang down. */
static double locks(double x, double y)
{
    double max = 0;

    for (int k = 0; k < LOCKS; k++) {
        const double side = k % 2 ? 1 : -1, out = 10 + 4 * k;

        for (double t = 0; t <= 1; t += 0.01)
            max = fmax(max, cover(0.9 -
                hypot(x - 127 - side * (38 + out * sin(2.2 * t)),
                      y - 110 - 10 * (k / 2) - 45 * t)));
    }
    return max;
}

/* Pixel i from its truth, with noise. */
static void mix(size_t i, struct random *r)
{
    const double noise = 3 * random_normal(r), a = d.person[i];

    for (size_t c = 3 * i; c < 3 * i + 3; c++)
        d.rgb[c] = (uint8_t)fmin(255, fmax(0, a * d.own[c] +
                                              (1 - a) * d.wall[c] + noise));
}

/* wall(x, y, c): the background. */
static void draw(const struct palette *p, double wall(double, double, int))
{
    static const double skin[3] = {205, 150, 125}, shirt[3] = {120, 60, 60};
    struct random r;

    random_init(&r, 4, p->name);
    d.inside = (struct extent){{0, N}, {0, N}};
    for (size_t i = 0; i < P; i++) {
        const double x = (double)(i % N), y = (double)(i / N);
        const double hair = fmax(cover(depth(x, y, 127, 112, 46, 56)),
                                 locks(x, y));
        const double face = cover(depth(x, y, 127, 124, 34, 42));

        d.person[i] = fmax(hair, cover(depth(x, y, 127, 240, 84, 70)));
        for (int c = 0; c < 3; c++) {
            const double own = hair > 0 ? p->hair[c] : shirt[c];

            d.own[3 * i + (size_t)c] = own + face * (skin[c] - own);
            d.wall[3 * i + (size_t)c] = wall ? wall(x, y, c) : p->wall[c];
        }
        mix(i, &r);
        d.head[i] = depth(x, y, 127, 122, 36, 46) > 0 ? 255 : 0;
    }
}

static struct matting found(void)
{
    return (struct matting){N, d.inside, d.rgb, d.alpha, d.confidence, d.back};
}

static void find(void)
{
    struct matting m = found();
    struct error err = {0};
    bool seen;

    REQUIRE(matte_find(&m, &seen, d.head, NULL, false, &err) == 0, "%s",
            err.text);
    check_that("without a network it is the head's outline that tells", !seen);
}

/* As a network would have it: the truth, blurred over 5 x 5 pixels. */
static void solve(void)
{
    static float prior[P];
    struct matting m = found();
    struct error err = {0};

    for (int y = 0; y < N; y++)
        for (int x = 0; x < N; x++) {
            double sum = 0, n = 0;

            for (int v = y - 2; v <= y + 2; v++)
                for (int u = x - 2; u <= x + 2; u++)
                    if (u >= 0 && v >= 0 && u < N && v < N) {
                        sum += d.person[v * N + u];
                        n++;
                    }
            prior[y * N + x] = (float)fmin(0.999, fmax(0.001, sum / n));
        }
    REQUIRE(matting_solve(&m, prior, N, false, &err) == 0, "%s", err.text);
}

/* Mean error of alpha over pixels of a share lo to hi. */
static double alpha_error(double lo, double hi)
{
    double sum = 0, n = 1e-9;

    for (size_t i = 0; i < P; i++)
        if (d.person[i] >= lo && d.person[i] <= hi) {
            sum += fabs(d.alpha[i] / 255.0 - d.person[i]);
            n++;
        }
    return sum / n;
}

/* Of the background where the person covers at least `min`, the share that is
 * off by more than `levels`. */
static double ghost(double min, double levels)
{
    double off = 0, n = 0;

    for (size_t i = 0; i < P; i++) {
        double max = 0;

        for (size_t c = 3 * i; c < 3 * i + 3; c++)
            max = fmax(max, fabs(d.back[c] - d.wall[c]));
        off += d.person[i] > min && max > levels;
        n += d.person[i] > min;
    }
    return off / n;
}

/* The person laid over another wall: mean distance from how that would look,
 * levels, over the pixels at the edge. */
static double halo(const double wall[3])
{
    double sum = 0, n = 0;

    for (size_t i = 0; i < P; i++) {
        const double m = d.alpha[i] / 255.0, a = d.person[i];

        if (a <= 0.02 || a >= 0.98)
            continue;
        for (size_t k = 0; k < 3; k++) {
            const size_t c = 3 * i + k;
            const double own = fmax(0, d.rgb[c] - (1 - m) * d.back[c]);

            sum += fabs(own + (1 - m) * wall[k] - a * d.own[c] -
                        (1 - a) * wall[k]) / 3;
        }
        n++;
    }
    return sum / n;
}

/* Most by which a channel of the picture misses any sum of both layers. */
static double imbalance(void)
{
    double max = 0;

    for (size_t c = 0; c < 3 * P; c++) {
        const double own = d.rgb[c] -
                           (255 - d.alpha[c / 3]) * d.back[c] / 255.0;

        if (is_inside(c / 3))
            max = fmax(max, fmax(-own, own - d.alpha[c / 3]));
    }
    return max;
}

static void test_hair(const struct palette *p, const double other[3])
{
    char text[80];

    draw(p, NULL);
    solve();
    snprintf(text, sizeof text, "%s: ghost, share of pixels", p->name);
    check(text, ghost(0.1, 12), 0.02);
    snprintf(text, sizeof text, "%s: halo, levels", p->name);
    check(text, halo(other), 6);
    snprintf(text, sizeof text, "%s: alpha where it is mixed", p->name);
    check(text, alpha_error(0.02, 0.98), 0.1);
    snprintf(text, sizeof text, "%s: and where it is not", p->name);
    check(text, fmax(alpha_error(0, 0), alpha_error(1, 1)), 0.006);
    snprintf(text, sizeof text, "%s: levels that both layers miss", p->name);
    check(text, imbalance(), 1.01);
}

/* By the head's outline alone: nearly all of the person, without the locks. */
static void test_outline(const struct palette *p)
{
    double both = 0, any = 0;
    char text[80];

    draw(p, NULL);
    find();
    for (size_t i = 0; i < P; i++) {
        const bool is = d.person[i] > 0.5, got = d.alpha[i] > 127;

        both += is && got;
        any += is || got;
    }
    snprintf(text, sizeof text, "%s: by the outline, IoU", p->name);
    check_range(text, both / any, 0.93, 1);
}

/* A forehead that shines like the wall behind it is the person's: the outline
 * of the head knows. */
static void test_shine(void)
{
    struct random r;
    uint8_t least = 255;

    draw(&palette[0], NULL);
    random_init(&r, 5, "shine");
    for (size_t i = 0; i < P; i++)
        if (depth((double)(i % N), (double)(i / N), 127, 108, 12, 8) > 0) {
            for (size_t c = 3 * i; c < 3 * i + 3; c++)
                d.own[c] = d.wall[c];
            mix(i, &r);
        }
    find();
    for (size_t i = 0; i < P; i++)
        if (d.head[i] && d.alpha[i] < least)
            least = d.alpha[i];
    check_range("by the outline: all of a head that shines", least, 250, 255);
}

static double blobs(double x, double y, int c)
{
    return 200 + 12 * sin(x / 3 + c) * sin(y / 4);
}

static void test_pattern(void)
{
    draw(&palette[0], blobs);
    solve();
    check("a patterned wall beside the person stays: alpha",
          alpha_error(0, 0), 0.01);
    check("and the person", alpha_error(1, 1), 0.01);
}

static double stripes(double x, double y, int c)
{
    return (int)floor(x / 16) % 2 ? 200 - 20 * c + 0 * y : 90 + 20 * c;
}

/* Stripes go on behind the head: a blur of them would be 40 levels off. */
static void test_texture(void)
{
    double off = 0, n = 0;

    draw(&palette[0], stripes);
    solve();
    for (size_t i = 0; i < P; i++)
        for (size_t c = 3 * i; c < 3 * i + 3 && d.person[i] >= 1; c++) {
            off += fabs(d.back[c] - d.wall[c]);
            n++;
        }
    check("stripes behind the person, mean levels off", off / n, 20);
}

/* Edges twice as soft as any lens's. */
static void test_soft_edge(void)
{
    struct random r;

    draw(&palette[0], NULL);
    random_init(&r, 7, "rim");
    for (size_t i = 0; i < P; i++) {
        const double deep = depth((double)(i % N), (double)(i / N), 127, 125,
                                  60, 75);
        const double t = fmin(1, fmax(0, (deep + 5) / 9));

        d.person[i] = t * t;
        for (size_t c = 3 * i; c < 3 * i + 3; c++)
            d.own[c] = palette[0].hair[c % 3];
        mix(i, &r);
    }
    solve();
    check("a soft edge: alpha, mean error", alpha_error(0.01, 0.99), 0.06);
    check("share of its pixels with a ghost", ghost(0.01, 12), 0.1);
}

/* Somebody who fills a two-hundredth of the picture is somebody. */
static void test_small(void)
{
    struct random r;
    double sum = 0;

    random_init(&r, 9, "small");
    d.inside = (struct extent){{0, N}, {0, N}};
    for (size_t i = 0; i < P; i++) {
        d.person[i] = cover(depth((double)(i % N), (double)(i / N), 60, 90, 9,
                                  11));
        d.head[i] = depth((double)(i % N), (double)(i / N), 60, 90, 7, 9) > 0
                        ? 255 : 0;
        for (size_t c = 3 * i; c < 3 * i + 3; c++) {
            d.wall[c] = palette[0].wall[c % 3];
            d.own[c] = palette[0].hair[c % 3];
        }
        mix(i, &r);
        sum += d.person[i];
    }
    find();
    for (size_t i = 0; i < P; i++)
        sum -= d.alpha[i] / 255.0;
    check("a small person's area, of 311 pixels", fabs(sum), 30);
}

/* A picture in the middle of its square: beyond it alpha is the prior's, rgb
 * both layers, and nothing is sure. */
static void test_beyond(void)
{
    double off = 0;
    bool confidence = false;

    draw(&palette[0], NULL);
    d.inside = (struct extent){{40, 216}, {0, 200}};
    for (size_t i = 0; i < P; i++)
        if (!is_inside(i))
            memset(d.rgb + 3 * i, 0, 3);
    solve();
    for (size_t i = 0; i < P; i++)
        if (!is_inside(i)) {
            confidence |= d.confidence[i] != 0;
            for (size_t c = 3 * i; c < 3 * i + 3 && d.alpha[i] == 0; c++)
                off = fmax(off, fabs(d.rgb[c] - d.wall[c]));
        }
    check("the wall goes on beyond the picture, levels", off, 14);
    check_that("where nothing is sure", !confidence);
    check_range("a body goes on below it", d.alpha[240 * N + 127], 250, 255);
    check_range("of its colour", d.rgb[3 * (240 * N + 127)], 100, 140);
}

/* How much row y differs from the one above it, levels on average. */
static double step(const uint8_t *plane, size_t channels, size_t y)
{
    const size_t n = N * channels;
    double sum = 0;

    for (size_t i = y * n; i < (y + 1) * n; i++)
        sum += abs(plane[i] - plane[i - n]);
    return sum / (double)n;
}

/* Guesses beyond a picture that are 60 levels off, with stripes: afterwards no
 * layer takes a larger step at the picture's edge than between its own rows,
 * but for a level, and the stripes are as deep as they were. */
static void test_no_seam(void)
{
    enum { TOP = 70, DEEP = 12 };
    struct matting m = found();
    struct error err = {0};

    m.inside = (struct extent){{0, N}, {TOP, N}};
    for (size_t i = 0; i < P; i++) {
        const size_t x = i % N, y = i / N;
        const bool in = y >= TOP;
        const int off = in ? 0 : 60 - 90 * (int)x / N + DEEP * (int)(x / 8 % 2);

        d.alpha[i] = (uint8_t)(128 - off + 60 * (int)x / N);
        for (size_t c = 3 * i; c < 3 * i + 3; c++) {
            d.back[c] = (uint8_t)(90 + off + (int)y / 4);
            d.rgb[c] = (uint8_t)(140 - off + (int)x / 4);
        }
    }
    REQUIRE(margin_fill(&m, &err) == 0, "%s", err.text);
    check("a picture's edge: step of alpha, levels", step(d.alpha, 1, TOP) -
          step(d.alpha, 1, TOP + 1), 1);
    check("of the background", step(d.back, 3, TOP) - step(d.back, 3, TOP + 1),
          1);
    check("of both layers together", step(d.rgb, 3, TOP) -
          step(d.rgb, 3, TOP + 1), 1);
    check("a guess's slopes stay, levels",
          fabs(d.back[3 * 127] - d.back[3 * 129] - (double)DEEP), 3);
}

/* A known matte is kept, and the layers are made. */
static void test_known(void)
{
    static uint8_t given[P];
    struct error err = {0};

    draw(&palette[1], NULL);
    struct matting m = found();
    for (size_t i = 0; i < P; i++)
        given[i] = d.alpha[i] = (uint8_t)lrint(255 * d.person[i]);
    REQUIRE(matting_solve(&m, NULL, 0, true, &err) == 0, "%s", err.text);
    check_that("a matte that is given stays", !memcmp(given, d.alpha, P));
    check("its background: share with a ghost", ghost(0.1, 12), 0.02);
}

/* Dark hair before a bright wall, of which a matte takes a tenth too little: the
 * background is the wall, not what the matte leaves of the hair. */
static void test_little(void)
{
    struct error err = {0};

    draw(&palette[0], NULL);
    struct matting m = found();
    for (size_t i = 0; i < P; i++)
        d.alpha[i] = (uint8_t)lrint(230 * d.person[i]);
    REQUIRE(matting_solve(&m, NULL, 0, true, &err) == 0, "%s", err.text);
    check("too small a matte: share with a ghost", ghost(0.6, 12), 0.02);
    check("levels that both layers miss", imbalance(), 1.01);
}

/* The same bytes from one thread and from three. */
static void test_threads(void)
{
    static uint8_t alpha[P], back[3 * P];

    draw(&palette[0], stripes);
    parallel_set_width(1);
    solve();
    memcpy(alpha, d.alpha, P);
    memcpy(back, d.back, 3 * P);
    parallel_set_width(3);
    solve();
    check_that("any number of threads", !memcmp(alpha, d.alpha, P) &&
               !memcmp(back, d.back, 3 * P));
}

/* Pieces of a prior: one apart from the head goes, one that a path joins to it
 * stays as far as the path does. */
static void test_connect(void)
{
    static float prior[MATTE_SIDE * MATTE_SIDE];
    static float out[MATTE_SIDE * MATTE_SIDE];
    static uint8_t head[MATTE_SIDE * MATTE_SIDE];
    const size_t w = MATTE_SIDE;

    for (size_t i = 0; i < w * w; i++) {
        const size_t x = i % w, y = i / w;
        const bool body = x > 100 && x < 150 && y > 100;

        head[i] = x > 110 && x < 140 && y > 110 && y < 150 ? 255 : 0;
        prior[i] = body ? 1 : x > 200 && y > 200 ? 0.9f : 0.02f;
        if (y == 120 && x >= 150 && x < 180)
            prior[i] = 0.6f;
        if (x >= 180 && x < 190 && y > 110 && y < 130)
            prior[i] = 0.8f;
    }
    matte_connect(out, prior, head);
    check("the body stays", fabs(out[250 * w + 125] - 1.0), 0);
    check("a piece apart is as unlikely as what is between",
          fabs(out[230 * w + 230] - 0.02), 1e-6);
    check("and one that is joined to it as likely as the joint",
          fabs(out[120 * w + 185] - 0.6), 1e-6);
}

int main(void)
{
    test_hair(&palette[0], palette[1].wall);
    test_hair(&palette[1], palette[0].wall);
    test_outline(&palette[0]);
    test_outline(&palette[1]);
    test_shine();
    test_soft_edge();
    test_pattern();
    test_texture();
    test_small();
    test_beyond();
    test_no_seam();
    test_known();
    test_little();
    test_threads();
    test_connect();
    return check_status();
}
