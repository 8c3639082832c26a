/* What of a person reaches past the matte: an edge softer than the matte's
 * leaves neither a ghost on the wall nor a picture that is not the sum of its
 * layers; a patterned wall, which no share of the person explains, stays as it
 * is; and the wall goes on behind a person who reaches the edges. */
#include <math.h>
#include <string.h>

#include "formats/layers.h"
#include "lib/base/random.h"
#include "tests/check.h"

enum { N = 512 };

static const double wall[3] = {226, 222, 214}, hair[3] = {46, 34, 52};

struct drawing {
    uint8_t rgb[3 * N * N], matte[N * N], back[3 * N * N], inside[N * N];
    double person[N * N], wall[3 * N * N];
};

/* How far a pixel lies inside an ellipse, in pixels, about. */
static double rim_depth(size_t i)
{
    return (1 - hypot(((double)(i % N) - 256) / 120,
                      ((double)(i / N) - 250) / 150)) * 120;
}

/* The wall, plain or of blobs that swing by 12 levels. */
static double rim_wall(size_t i, size_t c, bool pattern)
{
    const double x = (double)(i % N), y = (double)(i / N);

    return wall[c] - (pattern ? 24 - 12 * sin(x / 3 + c) * sin(y / 4) : 0);
}

/* A person whose share falls from 1 to 0 between these depths, the nearer to 0
 * the slower, and a matte that is `narrow` pixels narrower. */
static void rim_draw(struct drawing *d, bool pattern, double from, double to,
                     double narrow)
{
    struct random r;

    random_init(&r, 7, "rim");
    memset(d->inside, 255, sizeof d->inside);
    for (size_t i = 0; i < N * N; i++) {
        const double depth = rim_depth(i);
        const double t = fmin(1, fmax(0, (depth - to) / (from - to)));
        const double a = d->person[i] = t * t;

        d->matte[i] = depth > narrow + 0.5 ? 255 : depth < narrow - 0.5 ? 0
                      : 128;
        for (size_t c = 0; c < 3; c++) {
            d->wall[3 * i + c] = fmin(255, rim_wall(i, c, pattern) +
                                               1.5 * random_normal(&r));
            d->rgb[3 * i + c] = (uint8_t)lrint(
                a * hair[c] + (1 - a) * d->wall[3 * i + c]);
        }
    }
}

static void rim_split(struct drawing *d)
{
    struct error err = {0};

    REQUIRE(layers_split(d->matte, d->back, d->rgb, d->inside, N, &err) == 0,
            "%s", err.text);
}

/* Most by which a channel of the background misses the wall. */
static double rim_off(const struct drawing *d, size_t i)
{
    double most = 0;

    for (size_t c = 3 * i; c < 3 * i + 3; c++)
        most = fmax(most, fabs(d->back[c] - d->wall[c]));
    return most;
}

/* Most by which a channel of the picture misses any sum of both layers. */
static double rim_missing(const struct drawing *d, size_t i)
{
    double most = 0;

    for (size_t c = 3 * i; c < 3 * i + 3; c++) {
        const double own = d->rgb[c] -
                           (255 - d->matte[i]) * d->back[c] / 255.0;
        most = fmax(most, fmax(-own, own - d->matte[i]));
    }
    return most;
}

static void rim_test_soft_edge(void)
{
    static struct drawing d;
    double ghost = 0, error = 0, sum = 0, pixels = 0;

    rim_draw(&d, false, 4, -5, 2);
    rim_split(&d);
    for (size_t i = 0; i < N * N; i++) {
        sum = fmax(sum, rim_missing(&d, i));
        if (d.person[i] <= 0 || d.person[i] > 0.4)
            continue;
        ghost += rim_off(&d, i) > 10;
        error += fabs(d.matte[i] / 255.0 - d.person[i]);
        pixels++;
    }
    check("a soft edge: share of its pixels with a ghost", ghost / pixels,
          0.01);
    check("the matte there, mean error", error / pixels, 0.02);
    check("levels by which both layers miss the picture", sum, 1.01);
}

static void rim_test_pattern(void)
{
    static struct drawing d;
    double changed = 0, pixels = 0;

    rim_draw(&d, true, 0.5, -0.5, 0);
    rim_split(&d);
    for (size_t i = 0; i < N * N; i++) {
        const double depth = rim_depth(i);

        if (depth > -1 || depth < -6)
            continue;
        changed += rim_off(&d, i) > 2;
        pixels++;
    }
    check("a patterned wall: share of pixels beside him that change",
          changed / pixels, 0.01);
}

/* A square of `side` pixels of the hair's colour that the matte takes for the
 * person. */
static void rim_add_piece(struct drawing *d, size_t x, size_t y, size_t side)
{
    for (size_t i = 0; i < side * side; i++) {
        const size_t at = (y + i / side) * N + x + i % side;

        d->matte[at] = 255;
        for (size_t c = 0; c < 3; c++)
            d->rgb[3 * at + c] = (uint8_t)hair[c];
    }
}

/* Small pieces away from the person are no part of it; a body that something
 * crosses is, and so is a lock beside the head. */
static void rim_test_pieces(void)
{
    static struct drawing d;
    const size_t far = 100 * N + 460, body = 470 * N + 100;
    const size_t lock = 250 * N + 383;

    rim_draw(&d, false, 2, -2, 0);
    rim_add_piece(&d, 450, 90, 20);
    rim_add_piece(&d, 60, 430, 80);
    rim_add_piece(&d, 381, 248, 5);
    rim_split(&d);
    check_that("a piece away from the person goes", d.matte[far] == 0 &&
               memcmp(d.back + 3 * far, d.rgb + 3 * far, 3) == 0);
    check_that("a large one stays", d.matte[body] > 240);
    check_that("and a close one", d.matte[lock] > 200);
}

/* What is behind a person who reaches the edges of the picture is the wall,
 * there, too. */
static void rim_test_edges(void)
{
    static struct drawing d;
    double off = 0;

    rim_draw(&d, false, 2, -2, 0);
    rim_add_piece(&d, 156, 14, 200);   /* hair nearly up to the upper edge, */
    rim_add_piece(&d, 106, 362, 150);   /* shoulders to the lower one */
    rim_add_piece(&d, 256, 362, 150);
    rim_split(&d);
    for (size_t i = 0; i < N * N; i++)
        off = fmax(off, rim_off(&d, i));
    check("behind who reaches the edges: the wall, levels", off, 12);
}

int main(void)
{
    rim_test_pieces();
    rim_test_edges();
    rim_test_soft_edge();
    rim_test_pattern();
    return check_status();
}
