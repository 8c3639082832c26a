/* Case 09: l1, mse, psnr, ssim, ms-ssim and their gradients. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/lab/eval/image.h"
#include "tests/golden/golden.h"

struct pair {
    float *a, *b;          /* [3,H,W] */
    size_t H, W, n;        /* n = 3 H W */
};

static size_t clamp_index(long i, size_t n)
{
    return i < 0 ? 0 : i >= (long)n ? n - 1 : (size_t)i;
}

static void box_mean(struct pair *p, int r)
{
    for (size_t c = 0, k = 0; c < 3; c++)
        for (size_t y = 0; y < p->H; y++)
            for (size_t x = 0; x < p->W; x++, k++) {
                double sum = 0;

                for (int dy = -r; dy <= r; dy++)
                    for (int dx = -r; dx <= r; dx++)
                        sum += p->a[(c * p->H + clamp_index((long)y + dy,
                                                            p->H)) * p->W +
                                    clamp_index((long)x + dx, p->W)];
                p->b[k] = (float)(sum / ((2 * r + 1) * (2 * r + 1)));
            }
}

static void metrics_noise(struct pair *p, uint64_t seed, double amount)
{
    for (size_t i = 0; i < p->n; i++) {
        double v = p->a[i] + amount * (golden_u("input.noise", seed, i) - 0.5);

        p->b[i] = (float)fmax(0, fmin(1, v));
    }
}

static void metrics_shift(struct pair *p)
{
    for (size_t c = 0, k = 0; c < 3; c++)
        for (size_t y = 0; y < p->H; y++)
            for (size_t x = 0; x < p->W; x++, k++)
                p->b[k] = p->a[(c * p->H + (y + p->H - 2) % p->H) * p->W +
                               (x + p->W - 3) % p->W];
}

/* 0, or -1 for an unknown distortion. */
static int metrics_distort(struct pair *p, const char *how, uint64_t seed)
{
    if (!strcmp(how, "noisy")) {
        metrics_noise(p, seed, 0.4);
    } else if (!strcmp(how, "small_noise")) {
        metrics_noise(p, seed, 0.01);
    } else if (!strncmp(how, "blur", 4)) {
        box_mean(p, (atoi(how + 4) - 1) / 2);
    } else if (!strcmp(how, "invert")) {
        for (size_t i = 0; i < p->n; i++)
            p->b[i] = (float)(1.0 - p->a[i]);
    } else if (!strcmp(how, "shift")) {
        metrics_shift(p);
    } else if (!strcmp(how, "const")) {
        for (size_t i = 0; i < p->n; i++)
            p->b[i] = 0.5f;
    } else if (!strcmp(how, "other")) {
        free(p->b);
        p->b = golden_image("input.image2", seed, 3, p->H, p->W, false);
    } else if (!strcmp(how, "same")) {
        memcpy(p->b, p->a, p->n * sizeof *p->b);
    } else {
        return -1;
    }
    return 0;
}

/* Compare `count` doubles with <how>.<what> when the file has it, within the
 * file's own float32 tolerance. */
static void metrics_compare(struct golden *g, const char *how, const char *what,
                            const double *x, size_t count)
{
    char name[64], stored[80];
    float *f = malloc((count + 1) * sizeof *f);

    snprintf(name, sizeof name, "%s.%s", how, what);
    snprintf(stored, sizeof stored, "%s.err", name);
    if (f && golden_has(g, stored)) {
        for (size_t i = 0; i < count; i++)
            f[i] = (float)x[i];
        golden_compare(g, name, f, count);
    }
    free(f);
}

static void check_scales(struct golden *g, const char *how,
                         const struct pair *p, double *grad)
{
    struct metric_msssim m;
    double level[METRIC_LEVELS][2][3];

    if (metric_msssim(&m, grad, p->a, p->b, 3, p->H, p->W, NULL))
        return;                       /* too small: the file has none */
    metrics_compare(g, how, "msssim", &m.mean, 1);
    for (int l = 0; l < METRIC_LEVELS; l++)
        for (int k = 0; k < 2; k++)
            for (int c = 0; c < 3; c++)
                level[l][k][c] = m.level[l][k][c];
    metrics_compare(g, how, "msssim_levels", &level[0][0][0],
                    METRIC_LEVELS * 6);
    metrics_compare(g, how, "grad_msssim", grad, p->n);
}

static void check_pair(struct golden *g, const char *how,
                       const struct pair *p, double *map, double *grad)
{
    double v = metric_l1(p->a, p->b, p->n);
    size_t hw = p->H * p->W, valid = (p->H - 10) * (p->W - 10);
    struct metric_ssim s;

    metrics_compare(g, how, "l1", &v, 1);
    v = metric_mse(p->a, p->b, p->n);
    metrics_compare(g, how, "mse", &v, 1);
    v = metric_psnr(v);
    metrics_compare(g, how, "psnr", &v, 1);
    metric_ssim(&s, map, grad, p->a, p->b, 3, p->H, p->W, NULL);
    metrics_compare(g, how, "ssim", &s.mean, 1);
    metrics_compare(g, how, "ssim_channels", s.channel, 3);
    metrics_compare(g, how, "ssim_map0", map, valid);
    metrics_compare(g, how, "grad_ssim", grad, p->n);
    check_scales(g, how, p, grad);

    float *gray = malloc(2 * hw * sizeof *gray);
    if (gray) {
        metric_gray(gray, p->a, hw);
        metric_gray(gray + hw, p->b, hw);
        metric_ssim(&s, NULL, NULL, gray, gray + hw, 1, p->H, p->W, NULL);
        metrics_compare(g, how, "ssim_gray", &s.mean, 1);
    }
    free(gray);
}

static void run_metrics(struct golden *g)
{
    cJSON *shape = golden_json(g, "shape");
    cJSON *all = golden_json(g, "distortions"), *how;
    struct pair p = {0};

    p.H = (size_t)cJSON_GetArrayItem(shape, 1)->valuedouble;
    p.W = (size_t)cJSON_GetArrayItem(shape, 2)->valuedouble;
    p.n = 3 * p.H * p.W;
    p.a = golden_image("input.image", g->seed, 3, p.H, p.W, false);
    cJSON_ArrayForEach(how, all) {
        double *map = malloc(p.n * sizeof *map);
        double *grad = malloc(p.n * sizeof *grad);

        p.b = malloc(p.n * sizeof *p.b);
        if (!map || !grad || !p.b ||
            metrics_distort(&p, how->valuestring, g->seed))
            golden_check(g, how->valuestring, 1, 1, 0);
        else
            check_pair(g, how->valuestring, &p, map, grad);
        free(p.b);
        free(grad);
        free(map);
    }
    free(p.a);
    cJSON_Delete(all);
    cJSON_Delete(shape);
}

GOLDEN_CASE("09_metrics", run_metrics)
