/* Every output format written and read back; pure red stays red, in our own
 * reader and, where it is installed, through ffmpeg. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#include "formats/framesink.h"
#include "formats/image.h"
#include "formats/video.h"
#include "formats/y4m.h"
#include "tests/check.h"
#include "tests/folder.h"

/* Three frames of one colour, W x H. */
static int write_clip(const char *path, size_t W, size_t H, float r, float g,
                      float b, struct framesink_options opt,
                      struct error *err)
{
    float *color = malloc(3 * W * H * sizeof *color);
    float *alpha = malloc(W * H * sizeof *alpha);
    struct framesink_frame f = {
        .width = W, .height = H, .channels = 3, .color = color,
        .alpha = alpha
    };
    struct framesink *s;
    int rc = 0;

    for (size_t i = 0; i < W * H; i++) {
        alpha[i] = 1;
        color[3 * i] = r;
        color[3 * i + 1] = g;
        color[3 * i + 2] = b;
    }
    opt.path = path;
    s = framesink_open(&opt, err);
    for (f.frame = 0; s && rc == 0 && f.frame < 3; f.frame++)
        rc = framesink_write(s, &f, err);
    if (!s || rc != 0) {
        framesink_abandon(s);
        rc = -1;
    } else {
        rc = framesink_finish(s, err);
    }
    free(color);
    free(alpha);
    return rc;
}

static void test_y4m_numbers(void)
{
    static const struct {
        uint8_t rgb[3], want[3];
        bool bt601;
    } t[] = {
        {{255, 0, 0}, {63, 102, 240}, false},
        {{255, 0, 0}, {81, 90, 240}, true},
        {{255, 255, 255}, {235, 128, 128}, false},
        {{0, 0, 0}, {16, 128, 128}, false},
    };
    int max = 0;

    for (size_t i = 0; i < sizeof t / sizeof *t; i++) {
        struct y4m y = {.width = 1, .height = 1, .bt601 = t[i].bt601};
        uint8_t p[3];
        y4m_from_rgb(p, t[i].rgb, &y);
        check_that("y4m levels as published", memcmp(p, t[i].want, 3) == 0);
    }
    for (int full = 0; full < 2; full++)
        for (int i = 0; i < 1 << 15; i++) {
            struct y4m y = {.width = 1, .height = 1, .full = full};
            uint8_t a[3] = {(uint8_t)(i >> 10 << 3), (uint8_t)(i >> 5 << 3),
                            (uint8_t)(i << 3)}, p[3], b[3];
            y4m_from_rgb(p, a, &y);
            y4m_to_rgb(b, p, &y);
            for (int k = 0; k < 3; k++)
                max = abs(a[k] - b[k]) > max ? abs(a[k] - b[k]) : max;
        }
    printf("4:4:4 round trip: largest difference %d levels\n", max);
    check_that("4:4:4 round trip within 2 levels", max <= 2);
}

static void test_chroma(void)
{
    enum { W = 7, H = 5 };
    struct y4m y = {.width = W, .height = H, .chroma = Y4M_420,
                    .site_x = 0.5, .site_y = 0.5};
    const uint8_t rgb[3] = {200, 40, 90};
    uint8_t back[3 * W * H], planes[W * H + 2 * 4 * 3], one[3];
    int max = 0;

    check_that("odd sides round up", y4m_frame_bytes(&y) == sizeof planes);
    y4m_from_rgb(one, rgb, &(struct y4m){.width = 1, .height = 1});
    memset(planes, one[0], W * H);
    memset(planes + W * H, one[1], 4 * 3);
    memset(planes + W * H + 4 * 3, one[2], 4 * 3);
    y4m_to_rgb(back, planes, &y);
    for (size_t i = 0; i < sizeof back; i++)
        max = abs(rgb[i % 3] - back[i]) > max ? abs(rgb[i % 3] - back[i]) : max;
    check_that("4:2:0 of odd size keeps a flat colour", max <= 2);
}

static void test_pictures(void)
{
    static const char *const name[] = {"a-%03d.png", "a-%03d.exr",
                                       "a-%03d.pam"};
    struct error err = {0};
    struct image im = {0};

    for (int i = 0; i < 3; i++) {
        struct framesink_options opt = {.alpha = i == 0};
        err.code = 0;
        check_error(name[i],
                    write_clip(folder_at(name[i]), 5, 4, 1, 0, 0.5f, opt,
                               &err) == 0,
                    &err);
    }
    check_error("the PNG reads back",
                image_read(&im, folder_at("a-002.png"), &err) == 0 &&
                im.width == 5 && im.height == 4 && im.rgb[0] == 255 &&
                im.rgb[2] == 128 && !im.alpha,
                &err);
    image_release(&im);
    check_error("the EXR reads back",
                image_read(&im, folder_at("a-001.exr"), &err) == 0 &&
                im.rgb[0] == 255 && im.rgb[1] == 0 && im.rgb[2] == 128,
                &err);
    image_release(&im);
    check_that("no more files than frames, none unfinished",
               access(folder_at("a-003.png"), F_OK) != 0 &&
               access(folder_at("a-000.png.part"), F_OK) != 0);
}

static void test_video(void)
{
    struct error err = {0};
    struct framesink_options opt = {.rate_num = 30, .rate_den = 1};
    struct video_reader *v;
    const uint8_t *rgb = NULL;
    size_t W = 0, H = 0, n = 0;
    double t = 0;

    check_error("v.mp4",
                write_clip(folder_at("v.mp4"), 64, 48, 1, 0, 0, opt, &err) == 0,
                &err);
    v = video_open(folder_at("v.mp4"), false, &err);
    while (v && video_read(v, &rgb, &W, &H, &t, &err) == 1)
        if (n++ == 0) {
            printf("red comes back from mp4 as %d %d %d\n", rgb[0], rgb[1],
                   rgb[2]);
            check_that("pure red through mp4",
                       rgb[0] > 248 && rgb[1] < 8 && rgb[2] < 8);
        }
    check_error("three frames of the same size at 30 a second",
                n == 3 && W == 64 && H == 48 && fabs(t - 2 / 30.0) < 1e-3,
                &err);
    video_close(v);
    check_error("odd sizes",
                write_clip(folder_at("odd.mp4"), 63, 47, 1, 0, 0, opt,
                           &err) == 0,
                &err);
}

static int format_run(const char *format, const char *a, const char *b)
{
    char cmd[1024];

    snprintf(cmd, sizeof cmd, format, a, b);
    return system(cmd);
}

static void test_ffmpeg(void)
{
    struct error err = {0};
    struct framesink_options opt = {0};
    struct image im = {0};

    check_error("r.y4m",
                write_clip(folder_at("r.y4m"), 31, 17, 1, 0, 0, opt, &err) == 0,
                &err);
    if (system("command -v ffmpeg >/dev/null 2>&1") != 0) {
        printf("no ffmpeg here: its part left out\n");
        return;
    }
    check_error(
        "ffmpeg reads it",
        format_run("ffmpeg -v error -y -i %s -vf scale=in_color_matrix=bt709 "
                   "-frames:v 1 %s",
                   folder_at("r.y4m"), folder_at("r.png"))
                == 0
            && image_read(&im, folder_at("r.png"), &err) == 0,
        &err);
    printf("red comes back from y4m as %d %d %d\n", im.rgb ? im.rgb[0] : -1,
           im.rgb ? im.rgb[1] : -1, im.rgb ? im.rgb[2] : -1);
    check_that("pure red through ffmpeg",
               im.rgb && im.rgb[0] >= 253 && im.rgb[1] <= 2 && im.rgb[2] <= 2);
    image_release(&im);
    check_error("ffmpeg reads mp4",
                write_clip(folder_at("r.mp4"), 32, 18, 1, 0, 0, opt,
                           &err) == 0 &&
                format_run("ffmpeg -v error -y -i %s -frames:v 1 %s",
                           folder_at("r.mp4"), folder_at("s.png")) == 0 &&
                image_read(&im, folder_at("s.png"), &err) == 0,
                &err);
    check_that("pure red from mp4 through ffmpeg",
               im.rgb && im.rgb[0] > 248 && im.rgb[1] < 8 && im.rgb[2] < 8);
    image_release(&im);
}

static void test_refusals(void)
{
    struct error err = {0};
    struct framesink_options exr = {.format = FRAMESINK_EXR};
    struct framesink_options alpha = {.alpha = true};
    struct framesink_options plain = {0};

    check_error("EXR to a pipe is refused",
                write_clip("-", 2, 2, 1, 0, 0, exr, &err) != 0 &&
                err.code == EX_USAGE,
                &err);
    check_error("alpha in a video is refused",
                write_clip(folder_at("x.mp4"), 2, 2, 1, 0, 0, alpha,
                           &err) != 0 &&
                err.code == EX_USAGE,
                &err);
    check_error("three frames in one PNG are refused",
                write_clip(folder_at("one.png"), 2, 2, 1, 0, 0, plain,
                           &err) != 0 && err.code == EX_USAGE &&
                strstr(err.text, "pattern"),
                &err);
    check_error("a pattern with %s is refused",
                write_clip(folder_at("%s.png"), 2, 2, 1, 0, 0, plain,
                           &err) != 0 &&
                err.code == EX_USAGE,
                &err);
    check_error("a missing directory is named",
                write_clip("/nowhere/x.png", 2, 2, 1, 0, 0, plain,
                           &err) != 0 && err.code == EX_CANTCREAT,
                &err);
    check_error("and for a video",
                write_clip("/nowhere/x.mp4", 2, 2, 1, 0, 0, plain,
                           &err) != 0 && err.code == EX_CANTCREAT,
                &err);
}

int main(void)
{
    folder_make();
    test_y4m_numbers();
    test_chroma();
    test_pictures();
    test_video();
    test_ffmpeg();
    test_refusals();
    return folder_remove() || check_status();
}
