/* framesink_compose: every instruction set against the plain loop, and the
 * formulas on values worked by hand. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "formats/compose.h"
#include "formats/framesink.h"
#include "lib/base/cpu.h"
#include "lib/base/random.h"
#include "tests/check.h"

#define N 1031

static int compose_worst(const uint8_t *a, const uint8_t *b, size_t n)
{
    int max = 0;

    for (size_t i = 0; i < n; i++)
        if (abs(a[i] - b[i]) > max)
            max = abs(a[i] - b[i]);
    return max;
}

static void test_versions(void)
{
    static float color[3 * N], alpha[N];
    static uint8_t bg[3 * N], a[3 * N + 8], b[3 * N + 8];
    static uint16_t h[3 * N], g[3 * N];
    const struct compose_kernels *t = CPU_PICK(compose_kernels);
    struct random r;
    int max = 0, over = 0, half = 0;

    random_init(&r, 7, "compose");
    for (size_t i = 0; i < 3 * N; i++) {
        color[i] = (float)random_range(&r, -0.2, 1.2);
        bg[i] = (uint8_t)random_below(&r, 256);
    }
    for (size_t i = 0; i < N; i++)
        alpha[i] = (float)random_uniform(&r);
    color[5] = NAN;
    color[6] = INFINITY;
    color[17] = -INFINITY;
    for (size_t i = 100; i < 200; i++)     /* halves without exponent bits */
        color[i] *= ldexpf(1, -10 - (int)(i % 20));
    color[200] = 65519.9f;                 /* the last that is finite */
    color[201] = -65520;
    for (size_t n = 0; n <= N; n = n < 40 ? n + 1 : n + 331)
        for (size_t step = 0; step <= 3; step += 3) {
            memset(a, 0xa5, sizeof a);
            memset(b, 0xa5, sizeof b);
            compose_c(a, color, alpha, bg, step, n);
            t->blend(b, color, alpha, bg, step, n);
            max = fmax(max, compose_worst(a, b, 3 * n));
            over += memcmp(b + 3 * n, a + 3 * n, 8) != 0;
        }
    compose_quantise_c(a, color, 3 * N);
    t->quantise(b, color, 3 * N);
    max = fmax(max, compose_worst(a, b, 3 * N));
    color[5] = 0;
    compose_half_c(h, color, 3 * N);
    t->half(g, color, 3 * N);
    half = memcmp(h, g, sizeof h);
    printf("%s against plain: largest difference %d level\n",
           cpu_level_name(cpu_level()), max);
    check_that("versions agree within one level", max <= 1);
    check_that("nothing is written past the end", over == 0);
    check_that("halves are the same bits", half == 0);
}

/* Colours to planes are integers, so the versions are the same bytes. */
static void test_planes(void)
{
    static const int32_t m[3][4] = {{13933, 46871, 4732, 32768},
                                    {-7509, -25259, 32768, 8421376},
                                    {32768, -29763, -3005, 8421376}};
    static uint8_t rgb[3 * N], a[3][N + 8], b[3][N + 8];
    struct random r;
    int apart = 0;

    random_init(&r, 8, "planes");
    for (size_t i = 0; i < 3 * N; i++)
        rgb[i] = (uint8_t)(i < 600 ? 255 * (i / 3 >> i % 3 & 1)
                                   : random_below(&r, 256));
    for (size_t n = 0; n <= N; n = n < 40 ? n + 1 : n + 331) {
        memset(a, 0xa5, sizeof a);
        memset(b, 0xa5, sizeof b);
        compose_planes_c((uint8_t *[3]){a[0], a[1], a[2]}, rgb, n, m);
        CPU_PICK(compose_kernels)->planes((uint8_t *[3]){b[0], b[1], b[2]}, rgb, n, m);
        apart += memcmp(a, b, sizeof a) != 0;
    }
    check_that("planes are the same bytes, and end where they should",
               apart == 0);
}

/* And back. */
static void test_rgb(void)
{
    static const int32_t m[3][4] = {{76309, 0, 7344, -1188176},
                                    {76309, -874, -2183, -1188176},
                                    {76309, 8653, 0, -1188176}};
    static uint8_t luma[N], a[3 * N + 8], b[3 * N + 8];
    static int16_t u[N], v[N];
    struct random r;
    int apart = 0;

    random_init(&r, 9, "rgb");
    for (size_t i = 0; i < N; i++) {
        luma[i] = (uint8_t)random_below(&r, 256);
        u[i] = (int16_t)(random_below(&r, 4096) - 2048);
        v[i] = (int16_t)(random_below(&r, 4096) - 2048);
    }
    for (size_t n = 0; n <= N; n = n < 40 ? n + 1 : n + 331) {
        memset(a, 0xa5, sizeof a);
        memset(b, 0xa5, sizeof b);
        compose_rgb_c(a, luma, u, v, n, m);
        CPU_PICK(compose_kernels)->rgb(b, luma, u, v, n, m);
        apart += memcmp(a, b, sizeof a) != 0;
    }
    check_that("pixels of planes likewise", apart == 0);
}

static void test_formulas(void)
{
    float color[2 * 32] = {0}, alpha[2] = {1, 0.5f};
    uint8_t picture[6] = {10, 20, 30, 200, 100, 50}, out[6], rgba[8];
    struct framesink_frame f = {
        .width = 2, .height = 1, .channels = 32, .color = color,
        .alpha = alpha
    };
    struct background bg = {.rgb = picture, .width = 2, .height = 1};

    color[0] = 1;
    color[32 + 1] = 0.5f;
    framesink_compose(out, &f, &bg);
    check_that("an opaque pixel hides the background",
               out[0] == 255 && out[1] == 0 && out[2] == 0);
    check_that("half alpha adds half of the background",
               out[3] == 100 && out[4] == 178 && out[5] == 25);
    framesink_compose_rgba(rgba, &f);
    check_that("straight alpha divides the colour by alpha",
               rgba[4] == 0 && rgba[5] == 255 && rgba[7] == 128);
    f.alpha = NULL;
    framesink_compose(out, &f, &bg);
    check_that("without alpha nothing shows", out[3] == 0 && out[4] == 128);
}

static void test_background(void)
{
    struct background bg = {0};
    struct error err = {0};

    check_that("R,G,B is read",
               background_parse("255,128,0", &bg, &err) == 0 &&
               bg.color[1] == 128);
    check_that("#RRGGBB is read",
               background_parse("#102030", &bg, &err) == 0 &&
               bg.color[2] == 48);
    check_that("256 is refused",
               background_parse("256,0,0", &bg, &err) != 0 &&
               strstr(err.text, "expected"));
    background_release(&bg);
}

/* The versions at one instruction set, in a process of its own: the level is
 * decided once. */
static void at_level(const char *level)
{
    int status = 1;

    fflush(stdout);
    pid_t child = fork();

    if (child == 0) {
        setenv("SPID_CPU", level, 1);
        test_versions();
        test_planes();
        test_rgb();
        fflush(stdout);
        _exit(check_status());
    }
    if (child < 0 || waitpid(child, &status, 0) < 0)
        status = 1;
    check_that(level, status == 0);
}

int main(void)
{
    at_level("baseline");
    at_level("avx2");
    at_level("avx512");
    test_formulas();
    test_background();
    return check_status();
}
