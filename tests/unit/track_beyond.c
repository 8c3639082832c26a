/* A person beyond their picture's edges: the body widens, shoulders fall, a
 * head gets a dome with the hair's colour, and the picture's own pixels and
 * windows that show nothing else stay as they are. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "lib/photo/beyond.h"
#include "tests/check.h"

enum { N = 96 };

static uint8_t rgb[3 * N * N], matte[N * N], back[3 * N * N], inside[N * N];
static uint8_t before[3 * N * N];

/* A grey wall, seen in columns [x0,x1) and rows [y0,y1). */
static struct person picture(size_t x0, size_t x1, size_t y0, size_t y1)
{
    memset(back, 90, sizeof back);
    memset(rgb, 90, sizeof rgb);
    memset(matte, 0, sizeof matte);
    memset(inside, 0, sizeof inside);
    for (size_t y = y0; y < y1; y++)
        memset(inside + y * N + x0, 255, x1 - x0);
    return (struct person){.rgb = rgb, .matte = matte, .back = back,
                           .size = N};
}

/* Somebody of one grey in a box, as far as the picture shows it. */
static void paint(size_t x0, size_t x1, size_t y0, size_t y1, int grey)
{
    for (size_t y = y0; y < y1; y++)
        for (size_t x = x0; x < x1; x++)
            if (inside[y * N + x]) {
                matte[y * N + x] = 255;
                memset(rgb + 3 * (y * N + x), grey, 3);
            }
}

/* How many pixels of row y are the person's. */
static size_t wide(size_t y)
{
    size_t n = 0;

    for (size_t x = 0; x < N; x++)
        n += matte[y * N + x] > 127;
    return n;
}

/* How many pixels of column x are the person's. */
static size_t high(size_t x)
{
    size_t n = 0;

    for (size_t y = 0; y < N; y++)
        n += matte[y * N + x] > 127;
    return n;
}

/* What the picture shows, and what nobody leaves, is not touched. */
static void test_kept(void)
{
    struct person p = picture(0, N, 0, N);

    paint(20, 60, 0, N, 200);
    memcpy(before, rgb, sizeof rgb);
    beyond_continue(&p, inside);
    check_that("a whole picture stays", !memcmp(before, rgb, sizeof rgb));

    p = picture(20, 70, 20, 70);
    paint(40, 50, 30, 60, 200);
    rgb[0] = 7;
    beyond_continue(&p, inside);
    check_that("outside is the background", rgb[0] == 90);
    check_that("who leaves no edge does not go on",
               wide(19) + wide(70) + high(19) + high(70) == 0);
    check_that("the picture's own pixels stay",
               wide(40) == 10 && rgb[3 * (40 * N + 45)] == 200);
}

static void test_below(void)
{
    struct person p = picture(0, N, 0, 60);

    paint(30, 66, 20, 60, 200);
    beyond_continue(&p, inside);
    expect("a body's first row below", (double)wide(60), 36.5, 0.5);
    expect("and 36 rows below, 1 in 4 wider to each side", (double)wide(95),
           36 + 18, 2);
    expect("as bright as the edge", rgb[3 * (90 * N + 48)], 200, 0);
}

static void test_aside(void)
{
    struct person p = picture(20, 76, 0, N);
    double worst = 0, uneven = 0;

    paint(20, 76, 50, N, 200);
    beyond_continue(&p, inside);
    for (size_t d = 1; d <= 20; d++) {
        const double left = (double)high(20 - d), right = (double)high(75 + d);

        uneven = fmax(uneven, fabs(left - right));
        worst = fmax(worst, fabs(left - (46 - 0.5 * (double)d)));
    }
    check("shoulders fall by 1 in 2, pixels", worst, 1);
    check("to both sides alike, pixels", uneven, 0);
}

/* Skin between hair, cut above: the dome is 0.35 of 40 high. */
static void test_above(void)
{
    struct person p = picture(0, N, 40, N);
    bool round = true;

    paint(28, 68, 40, 80, 30);
    paint(33, 63, 40, 80, 200);
    beyond_continue(&p, inside);
    expect("a cut head's height in its middle", (double)high(48), 40 + 13.5,
           1);
    for (size_t y = 28; y < 40; y++)
        round &= wide(y) <= wide(y + 1);
    check_that("it narrows upwards", round);
    check("and is narrower near its top, pixels", (double)wide(30), 34);
    check("of hair there, grey", rgb[3 * (28 * N + 48)], 60);
    check_range("of skin at the edge, grey", rgb[3 * (39 * N + 48)], 150, 200);
}

int main(void)
{
    test_kept();
    test_below();
    test_aside();
    test_above();
    return check_status();
}
