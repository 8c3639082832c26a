/* The matte network about its convolutions: its loss against one computed
 * plainly, the gradient against differences, what it learns from (the picture
 * is the truth's composite, rooms and windows). */
#include <math.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/lab/data/clutter.h"
#include "lib/lab/data/portrait_sample.h"
#include "lib/net/matte_net.h"
#include "tests/check.h"

enum { N = 64 };

static void test_loss(void)
{
    enum { COUNT = 40 };
    float logit[COUNT], alpha[COUNT], weight[COUNT], d[COUNT], unused[COUNT];
    double want = 0, max = 0;
    struct random r;

    random_init(&r, 1, "matte loss");
    for (int i = 0; i < COUNT; i++) {
        double p;
        logit[i] = (float)(6 * random_normal(&r));
        alpha[i] = i % 3 ? (float)random_uniform(&r) : (float)(i % 2);
        weight[i] = i % 5 ? 1 : 0;
        p = 1 / (1 + exp(-(double)logit[i]));
        want -= 2.0 / COUNT * (double)weight[i] *
                ((double)alpha[i] * log(p) +
                 (1 - (double)alpha[i]) * log1p(-p));
    }
    check("cross entropy, relative",
          fabs(matte_net_loss(d, logit, alpha, weight, 2, COUNT) / want - 1),
          1e-6);
    for (int i = 0; i < COUNT; i++) {
        float keep = logit[i], h = 1e-2f;
        logit[i] = keep + h;
        double up = matte_net_loss(unused, logit, alpha, weight, 2, COUNT);
        logit[i] = keep - h;
        double down = matte_net_loss(unused, logit, alpha, weight, 2, COUNT);
        logit[i] = keep;
        max = fmax(max, fabs((up - down) / (2 * (double)h) - (double)d[i]));
    }
    check("its gradient against differences", max, 1e-5);
    logit[0] = 300;
    alpha[0] = weight[0] = 1;
    check_that("a sure logit is finite",
               isfinite(matte_net_loss(d, logit, alpha, weight, 2,
                                       COUNT)));
}

/* A disc of one colour before a wall, half of it hidden to the left. */
static void matte_paint(struct data_frame *f, uint8_t *rgba, uint8_t *alone,
                        uint8_t *hidden, const uint8_t person[3],
                        const uint8_t wall[3])
{
    *f = (struct data_frame){.size = N, .width = N, .height = N, .rgba = rgba,
                             .alone = alone, .hidden = hidden};
    for (int i = 0; i < N * N; i++) {
        double d = 20.5 - hypot(i % N - 31.5, i / N - 31.5);
        double m = fmin(1, fmax(0, d));
        rgba[4 * i + 3] = (uint8_t)(255 * m + 0.5);
        hidden[i] = i % N < 20;
        for (int c = 0; c < 3; c++) {
            alone[3 * i + c] = (uint8_t)(m * person[c] + 0.5);
            rgba[4 * i + c] = (uint8_t)(m * person[c] + (1 - m) * wall[c]
                                        + 0.5);
        }
    }
}

static void test_sample(void)
{
    static uint8_t rgba[4 * N * N], alone[3 * N * N], hidden[N * N];
    static float rgb[3 * N * N], alpha[N * N], weight[N * N];
    const uint8_t person[3] = {200, 30, 30}, wall[3] = {20, 20, 220};
    const struct data_augment plain = {0}, other = {.background = 1};
    struct error err = {0};
    struct data_frame f;
    struct random r;
    double off = 0, rim = 0;
    int changed = 0, open = 0;

    matte_paint(&f, rgba, alone, hidden, person, wall);
    random_init(&r, 2, "own");
    REQUIRE(!portrait_sample(rgb, alpha, weight, N, &f, &f, &plain, &r, &err),
            "%s", err.text);
    for (int i = 0; i < N * N; i++)
        for (int c = 0; c < 3; c++)
            off = fmax(off, fabs((double)rgb[3 * i + c] -
                                 ((double)alpha[i] * person[c] +
                                  (1 - (double)alpha[i]) * wall[c]) / 255));
    check("picture = alpha person + (1 - alpha) wall", off, 1.6 / 255);
    for (int k = 0; k < 12; k++) {
        random_init(&r, 3 + (uint64_t)k, "other");
        REQUIRE(!portrait_sample(rgb, alpha, weight, N, &f, &f, &other, &r,
                                 &err), "%s", err.text);
        for (int i = 0; i < N * N; i++) {
            bool blue = rgb[3 * i + 2] > 0.6f && rgb[3 * i] < 0.2f;
            if (weight[i] > 0 && alpha[i] >= 1)
                for (int c = 0; c < 3; c++)
                    rim = fmax(rim, fabs((double)rgb[3 * i + c] -
                                         person[c] / 255.0));
            changed += weight[i] > 0 && alpha[i] <= 0 && !blue;
            open += weight[i] > 0 && alpha[i] <= 0;
        }
    }
    check("the person before another wall is as before", rim, 1.6 / 255);
    check_that("the wall is another one", changed > 0.7 * open);
}

/* What a window about a face crop shows: all of it is drawn from memory that
 * is big enough, in range, and people keep their mask whatever they wear. */
static void test_window(void)
{
    enum { S = 48 };
    static uint8_t rgba[4 * N * N], alone[3 * N * N], hidden[N * N];
    static float rgb[3 * S * S], alpha[S * S], weight[S * S];
    const uint8_t person[3] = {90, 140, 60}, wall[3] = {240, 240, 240};
    const struct data_augment all = {1, 1, 1, 0};
    double min = 1, max = 0, seen = 0, outside = 0;
    struct error err = {0};
    struct data_frame f;
    struct random r;

    matte_paint(&f, rgba, alone, hidden, person, wall);
    memset(hidden, 0, sizeof hidden);
    f.crop = (struct square){32, 34, 34};
    for (int k = 0; k < 40; k++) {
        random_init(&r, 50 + (uint64_t)k, "window");
        REQUIRE(!portrait_sample(rgb, alpha, weight, S, &f, &f, &all, &r,
                                 &err), "%s", err.text);
        for (int i = 0; i < 3 * S * S; i++) {
            min = fmin(min, (double)rgb[i]);
            max = fmax(max, (double)rgb[i]);
        }
        for (int i = 0; i < S * S; i++) {
            seen += (double)alpha[i] / (40.0 * S * S);
            outside += weight[i] <= 0;
        }
    }
    check_that("colours from 0 to 1", min >= 0 && max <= 1);
    check_that("a window beyond the picture counts for nothing", outside > 0);
    check("share of the person in the mean, from 0.42", fabs(seen - 0.42), 0.1);
}

static void test_clutter(void)
{
    static float wall[3 * N * N], again[3 * N * N], row[3 * N];
    const struct clutter_patch none = {0};
    const float own[3] = {0.5f, 0.2f, 0.2f};
    double before = 0, after = 0, off = 0;
    struct random r;

    random_init(&r, 8, "clutter");
    clutter_paint(wall, N, &none, own, &r);
    random_init(&r, 8, "clutter");
    for (int i = 0; i < 3 * N * N; i++)
        again[i] = NAN;
    clutter_paint(again, N, &none, own, &r);
    check_that("the same numbers, the same room, whatever was there before",
               !memcmp(wall, again, sizeof wall));
    clutter_blur(again, row, N, 3);
    for (int y = 3; y < N - 3; y++)
        for (int x = 3; x < N - 3; x++) {
            double sum = 0;

            for (int k = 0; k < 49; k++)
                sum += (double)wall[3 * ((y + k / 7 - 3) * N + x + k % 7 - 3)];
            off = fmax(off, fabs(sum / 49 - (double)again[3 * (y * N + x)]));
            before += fabs((double)(wall[3 * (y * N + x)] -
                                    wall[3 * (y * N + x - 1)]));
            after += fabs((double)(again[3 * (y * N + x)] -
                                   again[3 * (y * N + x - 1)]));
        }
    check("the blur against sums over squares", off, 1e-4);
    check_that("a room has edges, a blurred one less", after < 0.7 * before);
}

int main(void)
{
    test_loss();
    test_sample();
    test_window();
    test_clutter();
    return check_status();
}
