/* How sure the encoder is: the logistic unit's gradient against differences,
 * pictures turned, negative samples and scenery. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "lib/lab/data/negative.h"
#include "lib/lab/data/scenery.h"
#include "lib/base/crop.h"
#include "lib/net/confidence_head.h"
#include "lib/track/rotated.h"
#include "tests/check.h"

enum { FEATURES = 7, SIDE = 96, CROP = 3 * CROP_NET * CROP_NET };

static void test_head(void)
{
    struct dense none = {0}, s;
    struct params ps;
    struct error err = {0};
    float pooled[FEATURES], *w, *g;
    double worst = 0;

    check_that("without a head it is sure", confidence_head_forward(&none, NULL) ==
               1);
    params_init(&ps);
    confidence_head_init(&s, &ps, "motion.", FEATURES);
    REQUIRE(!params_allocate(&ps, &err) &&
            !params_allocate_gradients(&ps, &err), "%s", err.text);
    params_randomise(&ps, 3);
    for (int k = 0; k < FEATURES; k++)
        pooled[k] = 0.3f * (float)(k - 3);
    w = param_w(&ps, s.weight);
    g = param_g(&ps, s.weight);
    for (int truth = 0; truth < 2; truth++) {
        memset(ps.g, 0, ps.total * sizeof *ps.g);
        confidence_head_loss(&s, pooled, truth, 0.5);
        double bias = (double)*param_g(&ps, s.bias);
        float own[FEATURES];
        memcpy(own, g, sizeof own);
        for (int k = 0; k <= FEATURES; k++) {
            float *at = k < FEATURES ? w + k : param_w(&ps, s.bias), was = *at;
            double lo, hi;

            *at = was - 1e-2f;
            lo = confidence_head_loss(&s, pooled, truth, 0.5);
            *at = was + 1e-2f;
            hi = confidence_head_loss(&s, pooled, truth, 0.5);
            *at = was;
            worst = fmax(worst, fabs((hi - lo) / 2e-2 -
                                     (k < FEATURES ? (double)own[k] : bias)));
        }
    }
    check("gradient of the logistic loss", worst, 2e-5);
    check("loss and probability agree",
          fabs(confidence_head_loss(&s, pooled, 1, 1) +
               log((double)confidence_head_forward(&s, pooled))), 1e-6);
    params_release(&ps);
}

static void test_turned(void)
{
    uint8_t rgb[2 * 3 * 3], alpha[6];
    struct image im = {.width = 3, .height = 2, .rgb = rgb, .alpha = alpha};
    struct image rotated, back;
    struct error err = {0};

    for (int i = 0; i < 18; i++)
        rgb[i] = (uint8_t)i;
    for (int i = 0; i < 6; i++)
        alpha[i] = (uint8_t)(10 * i);
    REQUIRE(!rotated_copy(&rotated, &im, 1, &err), "%s", err.text);
    /* clockwise: the bottom left pixel comes to the top left */
    check_that("a quarter turn", rotated.width == 2 && rotated.height == 3 &&
               rotated.rgb[0] == 9 && rotated.alpha[0] == 30 &&
               rotated.alpha[1] == 0 && rotated.alpha[5] == 20);
    REQUIRE(!rotated_copy(&back, &rotated, 3, &err), "%s", err.text);
    check_that("and back", back.width == 3 && !memcmp(back.rgb, rgb, 18) &&
               !memcmp(back.alpha, alpha, 6));
    image_release(&rotated);
    image_release(&back);
    REQUIRE(!rotated_copy(&rotated, &im, 2, &err), "%s", err.text);
    check_that("half a turn", rotated.alpha[0] == 50 && rotated.alpha[5] == 0);
    image_release(&rotated);
}

/* A frame with a bright square for a face. */
static void test_negative(void)
{
    static uint8_t rgba[SIDE * SIDE * 4];
    static float a[CROP], b[CROP];
    struct data_frame f = {
        .crop = {48, 48, 40}, .size = SIDE, .width = SIDE, .height = SIDE,
        .rgba = rgba
    };
    struct data_augment none = {0};
    double middle[NEGATIVE_COUNT] = {0};
    struct random r, again;
    struct error err = {0};
    bool same = true, inside = true;

    for (int i = 0; i < SIDE * SIDE; i++) {
        int x = i % SIDE, y = i / SIDE;

        memset(rgba + 4 * i, abs(x - 48) < 20 && abs(y - 48) < 20 ? 255 : 20,
               4);
    }
    for (int how = 0; how < NEGATIVE_COUNT; how++)
        for (uint64_t n = 0; n < 20; n++) {
            data_random(&r, 1, n, (uint64_t)how);
            data_random(&again, 1, n, (uint64_t)how);
            REQUIRE(!negative_sample(a, &f, (enum negative)how, &none, &r,
                                     &err) &&
                    !negative_sample(b, &f, (enum negative)how, &none, &again,
                                     &err), "%s", err.text);
            same = same && !memcmp(a, b, sizeof a);
            for (int i = 0; i < CROP; i++)
                inside = inside && a[i] >= 0 && a[i] <= 1;
            middle[how] += (double)a[3 * (CROP_NET / 2 * CROP_NET +
                                          CROP_NET / 2)] / 20;
        }
    check_that("the same crop from the same numbers", same);
    check_that("colours in range", inside);
    check_range("in place: the face in the middle", middle[NEGATIVE_NONE], 0.99,
                1.0001);
    check_range("turned: there, too", middle[NEGATIVE_ROTATED], 0.99,
                1.0001);
    check_range("missed: not there", middle[NEGATIVE_MISSED], 0, 0.1);
}

enum { WIDTH = 128, HEIGHT = 64 };

/* A panorama, a third of it a lamp a thousand times as bright as the rest, as
 * pictures and as crops. */
static void test_scenery(void)
{
    static float a[CROP];
    char path[] = "/tmp/spid-scenery-XXXXXX.pfm";
    int fd = mkstemps(path, 4);
    FILE *file = fd < 0 ? NULL : fdopen(fd, "wb");
    struct data_augment none = {0};
    struct scenery s = {0};
    struct names names = {0};
    struct error err = {0};
    struct random r;
    int lamps = 0, walls = 0;

    REQUIRE(file, "no file in /tmp");
    fprintf(file, "PF\n%d %d\n-1.0\n", WIDTH, HEIGHT);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        const float light = i % WIDTH < WIDTH / 3 ? 500 : 0.5f;

        for (int c = 0; c < 3; c++)
            fwrite(&light, sizeof light, 1, file);
    }
    fclose(file);
    REQUIRE(!names_add(&names, path, &err) &&
            !scenery_read(&s, &names, &err), "%s", err.text);
    unlink(path);
    check_that("a panorama at three exposures", s.count == 3);
    for (size_t k = 1; k < s.count; k++) {
        const uint8_t *dark = s.frame[k - 1].rgba, *bright = s.frame[k].rgba;
        const int wall = 4 * (WIDTH - 1);

        check_that("the next is brighter, what lies in the shade and the lamp",
                   dark[wall] > 50 && dark[wall] < bright[wall] - 20 &&
                   bright[wall] < 200 && bright[0] > 250 && dark[0] > 240);
    }
    for (uint64_t n = 0; n < 40; n++) {
        data_random(&r, 1, n, 0);
        REQUIRE(!negative_sample(a, s.frame, NEGATIVE_SCENERY, &none, &r,
                                 &err), "%s", err.text);
        const float middle = a[3 * (CROP_NET / 2 * CROP_NET + CROP_NET / 2)];

        lamps += middle > 0.9f;
        walls += middle > 0.2f && middle < 0.5f;
    }
    check_range("crops anywhere: a third of the lamp", lamps, 7, 20);
    check_range("... the rest not", walls, 20, 33);
    scenery_release(&s);
    REQUIRE(scenery_read(&s, &names, &err), "a file that is gone was read");
    check_that("a file that is gone is named", strstr(err.text, path) != NULL);
    scenery_release(&s);
    names_release(&names);
}

int main(void)
{
    test_head();
    test_turned();
    test_negative();
    test_scenery();
    return check_failures != 0;
}
