/* The face crop: sampling against the double reference, a known head through any
 * crop and back, and that gradient against finite differences. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/cpu.h"
#include "lib/base/random.h"
#include "lib/base/crop.h"
#include "lib/base/mipmap.h"
#include "tests/check.h"

static struct square some_square(struct random *r, size_t W, size_t H)
{
    return (struct square){
        random_range(r, -0.3 * (double)W, 1.3 * (double)W),
        random_range(r, -0.3 * (double)H, 1.3 * (double)H),
        exp(random_range(r, log(0.01), log(3.0 * (double)(W + H))))
    };
}

static void test_sampling(void)
{
    struct random r;
    double max = 0, over = 0;

    random_init(&r, 3, "crop");
    for (int t = 0; t < 300; t++) {
        size_t W = 1 + random_below(&r, 70), H = 1 + random_below(&r, 70);
        size_t n = 1 + random_below(&r, 40), stride = 3 * W + 5;
        uint8_t *u = malloc(H * stride);
        double *d = malloc(3 * W * H * sizeof *d);
        double *want = malloc(3 * n * n * sizeof *want);
        float *got = malloc((3 * n * n + 1) * sizeof *got);
        struct square q = some_square(&r, W, H);
        for (size_t y = 0; y < H; y++)
            for (size_t x = 0; x < 3 * W; x++) {
                u[y * stride + x] = (uint8_t)random_below(&r, 256);
                d[y * 3 * W + x] = u[y * stride + x] / 255.0;
            }
        crop_sample_ref(want, n, d, W, H, q);
        got[3 * n * n] = 77;
        crop_sample_u8(got, n, u, W, H, stride, q);
        over += got[3 * n * n] != 77;
        for (size_t i = 0; i < 3 * n * n; i++)
            max = fmax(max, fabs(got[i] - want[i]));
        free(u);
        free(d);
        free(want);
        free(got);
    }
    printf("instruction set %s\n", cpu_level_name(cpu_level()));
    check("8-bit sampling against double", max, 1e-6);
    check("writes past the end", over, 0);
}

static void crop_project(double uv[2], const double x[3], const double t[3],
                         double S, double f)
{
    for (int k = 0; k < 2; k++)
        uv[k] = S / 2 + f * (x[k] + t[k]) / (x[2] + t[2]);
}

/* A head's points by the window's camera, and through the network's
 * translation for some crop, stored as floats in between. */
static void test_translation(void)
{
    const double S = 512, f = 12 * S / 2;
    double worst = 0, origin = 0, worst_g = 0;
    struct random r;

    random_init(&r, 9, "crop translation");
    for (int i = 0; i < 2000; i++) {
        struct square c = {random_range(&r, 0, S), random_range(&r, 0, S),
                           random_range(&r, 40, 700)};
        double t[3] = {random_range(&r, -1, 1), random_range(&r, -1, 1),
                       random_range(&r, 6, 30)}, n[3], b[3], u[2], v[2];
        double x[3] = {random_range(&r, -0.7, 0.7),
                       random_range(&r, -0.7, 0.7),
                       random_range(&r, -0.6, 0.6)};
        double zero[3] = {0};
        crop_translation_inverse(n, t, c, S, f);
        for (int k = 0; k < 3; k++)
            n[k] = (float)n[k];
        crop_translation(b, n, c, S, f);
        crop_project(u, x, t, S, f);
        crop_project(v, x, b, S, f);
        worst = fmax(worst, hypot(u[0] - v[0], u[1] - v[1]));
        /* the head's origin: the crop's own picture, mapped back */
        crop_project(u, zero, t, S, f);
        crop_project(v, zero, n, S, f);
        for (int k = 0; k < 2; k++)
            v[k] = (k ? c.y : c.x) + (v[k] - S / 2) * c.size / S;
        origin = fmax(origin, hypot(u[0] - v[0], u[1] - v[1]));
    }
    check("a head through any crop and back, pixels", worst, 0.01);
    check("its origin in the crop's own picture, pixels", origin, 0.01);
    for (int k = 0; k < 6; k++) {
        double tn[3] = {0.1, -0.2, 7}, gt[3] = {0.3, -0.7, 0.9};
        double p[6] = {0.1, -0.2, 7, 200, 300, 280}, g[6] = {0}, h = 1e-5;
        double l[2], t[3];
        struct square c = {200, 300, 280};
        crop_translation_backward(g, g + 3, gt, tn, c, S, f);
        for (int s = 0; s < 2; s++) {
            double m[6];
            memcpy(m, p, sizeof m);
            m[k] += s ? h : -h;
            c = (struct square){m[3], m[4], m[5]};
            crop_translation(t, m, c, S, f);
            l[s] = t[0] * gt[0] + t[1] * gt[1] + t[2] * gt[2];
        }
        worst_g = fmax(worst_g, fabs((l[1] - l[0]) / (2 * h) - g[k]));
    }
    check("gradient of the translation", worst_g, 1e-7);
}

static void test_squares(void)
{
    struct square w = {300, 200, 440}, q = {310, 222, 180}, p;
    float xy[6] = {10, 20, 30, 25, 15, 60};

    p = square_out_of(square_into(q, w, 512), w, 512);
    check("a square into a window and out again",
          fabs(p.x - q.x) + fabs(p.size - q.size), 1e-9);
    p = crop_from_landmarks(xy, 3);
    check_that("the landmarks' square",
               p.x == 20 && p.y == 40 && fabs(p.size - 64) < 1e-9);
    p = window_from_crop(crop_from_detection(q));
    check_that("the window is about the detector's face",
               fabs(p.x - q.x) + fabs(p.y - q.y) < 1e-9 &&
               fabs(p.size - CROP_WINDOW * q.size) < 1e-9);
}

static void test_resize(void)
{
    enum { W = 90, H = 60, n = 20 };
    static uint8_t rgb[3 * W * H], out[3 * n * n], same[3 * n * n];
    int flat = 0, exact = 0, mixed = 0;
    struct square q = {45, 30, 40}, one = {30, 30, 20}, far = {-500, 0, 40};
    struct square over[] = {{41.3, 28.7, 137}, {40.2, 31.1, 19.4}, {3, 2, 11}};

    memset(rgb, 137, sizeof rgb);
    crop_resize_u8(out, n, rgb, W, H, 3 * W, 3, q);
    for (size_t i = 0; i < sizeof out; i++)
        flat |= out[i] != 137;
    check("a flat picture stays flat when it shrinks", flat, 0);
    for (size_t k = 0; k < sizeof over / sizeof *over; k++) {
        crop_resize_u8(out, n, rgb, W, H, 3 * W, 3, over[k]);
        const struct extent in = square_extent(n, W, H, over[k]);
        for (size_t i = 0; i < sizeof out; i++)
            mixed += out[i] !=
                     (extent_has(&in, i / 3 % n, i / 3 / n) ? 137 : 0);
    }
    check("no black is mixed into the picture's edge", mixed, 0);
    for (size_t i = 0; i < sizeof rgb; i++)
        rgb[i] = (uint8_t)(i * 7);
    crop_resize_u8(same, n, rgb, W, H, 3 * W, 3, one);
    for (size_t y = 0; y < n; y++)
        exact |= memcmp(same + 3 * n * y, rgb + 3 * ((20 + y) * W + 20),
                        3 * n) != 0;
    check("at scale one the pixels are the picture's", exact, 0);
    crop_resize_u8(out, n, rgb, W, H, 3 * W, 3, far);
    flat = 0;
    for (size_t i = 0; i < sizeof out; i++)
        flat |= out[i];
    check("outside is black", flat, 0);
}

static void time_crop(void)
{
    size_t W = 512, H = 512;
    uint8_t *u = calloc(3, W * H);
    float *out = malloc((3 * CROP_NET * CROP_NET) * sizeof *out);
    double best = 1;

    for (int i = 0; i < 40; i++) {
        double t = cpu_seconds();
        crop_sample_u8(out, CROP_NET, u, W, H, 3 * W,
                       (struct square){250, 270, 287});
        best = fmin(best, cpu_seconds() - t);
    }
    printf("face crop 287 -> 224: %.3f ms\n", best * 1e3);
    free(u);
    free(out);
}

/* Pixels of level k of a picture of which `made` is there that are not the mean
 * of 2 x 2 of the level before, rounded. */
static size_t count_wrong(const struct mipmap *m, size_t k)
{
    const struct mipmap_level *l = m->level + k, *from = l - 1;
    size_t wrong = 0;

    for (size_t y = l->made.y[0]; y < l->made.y[1]; y++)
        for (size_t x = 3 * l->made.x[0]; x < 3 * l->made.x[1]; x++) {
            const uint8_t *a = from->rgb + 3 * (2 * y * from->W + x / 3 * 2) +
                               x % 3;
            const uint8_t *b = a + 3 * from->W;

            wrong += l->rgb[3 * y * l->W + x] != (a[0] + a[3] + b[0] + b[3] + 2) / 4;
        }
    return wrong;
}

/* Squares of pictures, cut while more and more of their levels is there, and
 * again from a mipmap that has all of them. */
static void test_mipmap(void)
{
    struct mipmap some = {0}, all = {0};
    struct error err = {0};
    struct random r;
    size_t wrong = 0;
    int differ = 0;

    random_init(&r, 5, "mipmap");
    for (int t = 0; t < 40; t++) {
        const size_t W = 1 + random_below(&r, 300), H = 1 + random_below(&r, 300);
        enum { N = 9 };
        float a[3 * N * N], b[3 * N * N];
        uint8_t *u = malloc(3 * W * H);

        for (size_t i = 0; i < 3 * W * H; i++)
            u[i] = (uint8_t)random_below(&r, 256);
        REQUIRE(!mipmap_take(&some, u, W, H, &err) &&
                !mipmap_take(&all, u, W, H, &err), "%s", err.text);
        mipmap_whole(&all, all.levels - 1);
        for (int i = 0; i < 9; i++) {
            const struct square q = some_square(&r, W, H);

            mipmap_sample(a, N, &some, q);
            mipmap_sample(b, N, &all, q);
            differ += memcmp(a, b, sizeof a) != 0;
        }
        for (size_t k = 1; k < some.levels; k++)
            wrong += count_wrong(&some, k) + count_wrong(&all, k);
        free(u);
    }
    check("a mipmap's pixels other than means", (double)wrong, 0);
    check("squares other than from a whole mipmap", differ, 0);
    mipmap_release(&some);
    mipmap_release(&all);
}

int main(void)
{
    test_sampling();
    test_translation();
    test_squares();
    test_resize();
    test_mipmap();
    time_crop();
    return check_status();
}
