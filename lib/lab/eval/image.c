/* Distances between two pictures as in the paper's tables: L1, PSNR, SSIM
 * (Wang et al. 2004: 11x11 Gaussian window, valid region) and MS-SSIM (Wang et
 * al. 2003: five levels), in double precision, with gradients for training. */
#include "lib/lab/eval/image.h"

#include <math.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/arena.h"
#include "lib/lab/eval/filter.h"

#define C1 1e-4 /* (0.01 L)^2 with L = 1 */
#define C2 9e-4 /* (0.03 L)^2 */

static const double level_weight[METRIC_LEVELS] = {0.0448, 0.2856, 0.3001,
                                                   0.2363, 0.1333};

double metric_l1(const float *a, const float *b, size_t n)
{
    double sum = 0;

    for (size_t i = 0; i < n; i++)
        sum += fabs((double)a[i] - (double)b[i]);
    return sum / (double)n;
}

double metric_mse(const float *a, const float *b, size_t n)
{
    double sum = 0;

    for (size_t i = 0; i < n; i++) {
        double d = (double)a[i] - (double)b[i];

        sum += d * d;
    }
    return sum / (double)n;
}

double metric_psnr(double mse)
{
    return mse > 0 ? -10 * log10(mse) : INFINITY;
}

/* Luma (BT.601) of pixel i of planar rgb [3,n]. */
static double metric_luma_at(const float *rgb, size_t n, size_t i)
{
    return 0.2989 * (double)rgb[i] + 0.587 * (double)rgb[n + i] +
           0.114 * (double)rgb[2 * n + i];
}

void metric_gray(float *gray, const float *rgb, size_t n)
{
    for (size_t i = 0; i < n; i++)
        gray[i] = (float)metric_luma_at(rgb, n, i);
}

void metric_planar_u8(float *planar, const uint8_t *rgb, size_t n)
{
    for (size_t c = 0; c < 3; c++)
        for (size_t i = 0; i < n; i++)
            planar[c * n + i] = (float)rgb[3 * i + c] / 255;
}

double metric_edges(const float *rgb, size_t H, size_t W)
{
    const size_t n = H * W;
    double sum = 0;

    for (size_t y = 0; y + 1 < H; y++)
        for (size_t x = 0; x + 1 < W; x++) {
            const size_t i = y * W + x;
            double here = metric_luma_at(rgb, n, i);
            double dx = metric_luma_at(rgb, n, i + 1) - here;
            double dy = metric_luma_at(rgb, n, i + W) - here;

            sum += sqrt(dx * dx + dy * dy);
        }
    return sum / (double)((H - 1) * (W - 1));
}

double metric_flicker(const float *a0, const float *a1, const float *b0,
                      const float *b1, size_t n)
{
    double sum = 0;

    for (size_t i = 0; i < n; i++)
        sum += fabs(((double)b1[i] - b0[i]) - ((double)a1[i] - a0[i]));
    return sum / (double)n;
}

/* ---- one plane at one scale ------------------------------------------- */

/* Planes of up to H*W values. */
struct work {
    struct arena memory;
    double *tmp, *prod;            /* scratch of metric_blur; a product */
    double *mu_a, *mu_b;           /* means, then ... */
    double *aa, *bb, *ab;          /* ... second moments, [h,w] */
    double *spread;
};

/* For planes of n pixels. */
static int metric_work_init(struct work *k, size_t n, struct error *err)
{
    double **const plane[] = {&k->tmp, &k->prod, &k->mu_a, &k->mu_b,
                              &k->aa, &k->bb, &k->ab, &k->spread};

    for (size_t i = 0; i < sizeof plane / sizeof *plane; i++)
        *plane[i] = arena_take(&k->memory, n, sizeof **plane[i]);
    return arena_check(&k->memory, "planes", err);
}

/* out = window * (x y). */
static void metric_blur_product(double *out, const double *x, const double *y,
                                size_t H, size_t W, struct work *k)
{
    for (size_t i = 0; i < H * W; i++)
        k->prod[i] = x[i] * y[i];
    metric_blur(out, k->prod, H, W, k->tmp);
}

/* Means, and means of squares and of the product, under the window. */
static void metric_moments(struct work *k, const double *a, const double *b,
                           size_t H, size_t W)
{
    metric_blur(k->mu_a, a, H, W, k->tmp);
    metric_blur(k->mu_b, b, H, W, k->tmp);
    metric_blur_product(k->aa, a, a, H, W, k);
    metric_blur_product(k->bb, b, b, H, W, k);
    metric_blur_product(k->ab, a, b, H, W, k);
}

/* Means of ssim and cs over one plane; map may be NULL. */
static void metric_plane_ssim(double *ssim, double *cs, double *map,
                              const double *a, const double *b, size_t H,
                              size_t W, struct work *k)
{
    size_t n = (H - METRIC_WINDOW + 1) * (W - METRIC_WINDOW + 1);
    double sum_s = 0, sum_c = 0;

    metric_moments(k, a, b, H, W);
    for (size_t i = 0; i < n; i++) {
        double ma = k->mu_a[i], mb = k->mu_b[i];
        double va = k->aa[i] - ma * ma, vb = k->bb[i] - mb * mb;
        double vab = k->ab[i] - ma * mb;
        double l = (2 * ma * mb + C1) / (ma * ma + mb * mb + C1);
        double c = (2 * vab + C2) / (va + vb + C2);

        sum_s += l * c;
        sum_c += c;
        if (map)
            map[i] = l * c;
    }
    *ssim = sum_s / (double)n;
    *cs = sum_c / (double)n;
}

/* db += gs * d(mean ssim)/db + gc * d(mean cs)/db. */
static void metric_plane_ssim_backward(double *db, double gs, double gc,
                                       const double *a, const double *b,
                                       size_t H, size_t W, struct work *k)
{
    size_t n = (H - METRIC_WINDOW + 1) * (W - METRIC_WINDOW + 1);

    metric_moments(k, a, b, H, W);
    for (size_t i = 0; i < n; i++) {
        double ma = k->mu_a[i], mb = k->mu_b[i];
        double a1 = 2 * ma * mb + C1, b1 = ma * ma + mb * mb + C1;
        double a2 = 2 * (k->ab[i] - ma * mb) + C2;
        double b2 = k->aa[i] - ma * ma + k->bb[i] - mb * mb + C2;
        double l = a1 / b1, c = a2 / b2;
        double dl = gs * c / (double)n;             /* ssim = l c */
        double dc = (gs * l + gc) / (double)n;
        double dvab = dc * 2 / b2, dvb = -dc * c / b2;

        k->mu_b[i] = dl * 2 * (ma - l * mb) / b1    /* through l */
                     - dvab * ma - dvb * 2 * mb;    /* and the variances */
        k->bb[i] = dvb;
        k->ab[i] = dvab;
    }
    metric_blur_transpose(k->spread, k->mu_b, H, W, k->tmp);
    for (size_t i = 0; i < H * W; i++)
        db[i] += k->spread[i];
    metric_blur_transpose(k->spread, k->bb, H, W, k->tmp);
    for (size_t i = 0; i < H * W; i++)
        db[i] += 2 * b[i] * k->spread[i];
    metric_blur_transpose(k->spread, k->ab, H, W, k->tmp);
    for (size_t i = 0; i < H * W; i++)
        db[i] += a[i] * k->spread[i];
}

/* float to double. */
static void metric_plane_widen(double *out, const float *in, size_t n)
{
    for (size_t i = 0; i < n; i++)
        out[i] = in[i];
}

int metric_ssim(struct metric_ssim *out, double *map, double *db,
                const float *a, const float *b, size_t C, size_t H, size_t W,
                struct error *err)
{
    struct work k = {.tmp = NULL};
    size_t n = H * W;
    double *pa, *pb, cs;
    int rc;

    if (H < METRIC_WINDOW || W < METRIC_WINDOW || C < 1 ||
        C > METRIC_CHANNELS)
        return error_set(err, EX_DATAERR,
                         "ssim of %zux%zux%zu (expected sides of 11 or more "
                         "and 1 to 4 channels)", C, H, W);
    pa = arena_take(&k.memory, n, sizeof *pa);
    pb = arena_take(&k.memory, n, sizeof *pb);
    rc = metric_work_init(&k, n, err);
    memset(out, 0, sizeof *out);
    if (db)
        memset(db, 0, C * n * sizeof *db);
    for (size_t c = 0; rc == 0 && c < C; c++) {
        size_t valid = (H - METRIC_WINDOW + 1) * (W - METRIC_WINDOW + 1);

        metric_plane_widen(pa, a + c * n, n);
        metric_plane_widen(pb, b + c * n, n);
        metric_plane_ssim(&out->channel[c], &cs, map ? map + c * valid : NULL,
                          pa, pb, H, W, &k);
        out->mean += out->channel[c] / (double)C;
        if (db)
            metric_plane_ssim_backward(db + c * n, 1 / (double)C, 0, pa, pb,
                                       H, W, &k);
    }
    arena_release(&k.memory);
    return rc;
}

/* ---- scales ----------------------------------------------------------- */

/* Side of the next level. */
static size_t metric_half_size(size_t n)
{
    return (n + 1) / 2; /* an odd side is padded to n + 2, then floored */
}

/* 2x2 means of in [H,W]; an odd side has a zero before and after it. */
static void metric_plane_halve(double *out, const double *in, size_t H,
                               size_t W)
{
    size_t h = metric_half_size(H), w = metric_half_size(W), py = H % 2,
           px = W % 2;

    memset(out, 0, h * w * sizeof *out);
    for (size_t y = 0; y < H; y++)
        for (size_t x = 0; x < W; x++)
            if ((y + py) / 2 < h && (x + px) / 2 < w)
                out[(y + py) / 2 * w + (x + px) / 2] += 0.25 * in[y * W + x];
}

/* Transpose of halve, added to din. */
static void metric_halve_backward(double *din, const double *dout, size_t H,
                                  size_t W)
{
    size_t h = metric_half_size(H), w = metric_half_size(W), py = H % 2,
           px = W % 2;

    for (size_t y = 0; y < H; y++)
        for (size_t x = 0; x < W; x++)
            if ((y + py) / 2 < h && (x + px) / 2 < w)
                din[y * W + x] += 0.25 * dout[(y + py) / 2 * w +
                                              (x + px) / 2];
}

/* The pyramid of one plane: offsets of the levels and their sizes. */
struct pyramid {
    size_t h[METRIC_LEVELS], w[METRIC_LEVELS], at[METRIC_LEVELS], total;
};

/* Sizes of the five levels of an H x W picture and where each begins. */
static void metric_pyramid_layout(struct pyramid *p, size_t H, size_t W)
{
    p->total = 0;
    for (int l = 0; l < METRIC_LEVELS; l++) {
        p->h[l] = H;
        p->w[l] = W;
        p->at[l] = p->total;
        p->total += H * W;
        H = metric_half_size(H);
        W = metric_half_size(W);
    }
}

/* One channel and its halved copies. */
static void metric_pyramid_fill(double *pyr, const struct pyramid *p,
                                const float *plane)
{
    metric_plane_widen(pyr, plane, p->h[0] * p->w[0]);
    for (int l = 1; l < METRIC_LEVELS; l++)
        metric_plane_halve(pyr + p->at[l], pyr + p->at[l - 1], p->h[l - 1],
                           p->w[l - 1]);
}

/* Product over the levels of one channel, and its derivative by each. */
static double metric_level_product(double d[METRIC_LEVELS],
                                   const struct metric_msssim *m, size_t c)
{
    double product = 1;

    for (int l = 0; l < METRIC_LEVELS; l++) {
        double v = m->level[l][l < METRIC_LEVELS - 1][c];

        product *= v > 0 ? pow(v, level_weight[l]) : 0;
    }
    for (int l = 0; l < METRIC_LEVELS; l++) {
        double v = m->level[l][l < METRIC_LEVELS - 1][c];

        d[l] = product > 0 ? product * level_weight[l] / v : 0;
    }
    return product;
}

/* One channel of MS-SSIM; dpyr (as large as a pyramid) and db may be NULL. */
static void metric_msssim_channel(struct metric_msssim *out, double *db,
                                  double *dpyr, const double *pa,
                                  const double *pb, const struct pyramid *p,
                                  size_t c, size_t C, struct work *k)
{
    double d[METRIC_LEVELS];

    for (int l = 0; l < METRIC_LEVELS; l++)
        metric_plane_ssim(&out->level[l][0][c], &out->level[l][1][c], NULL,
                          pa + p->at[l], pb + p->at[l], p->h[l], p->w[l], k);
    out->mean += metric_level_product(d, out, c) / (double)C;
    if (!db)
        return;
    memset(dpyr, 0, p->total * sizeof *dpyr);
    for (int l = METRIC_LEVELS - 1; l >= 0; l--) {
        int last = l == METRIC_LEVELS - 1;

        metric_plane_ssim_backward(dpyr + p->at[l], last ? d[l] / (double)C : 0,
                                   last ? 0 : d[l] / (double)C, pa + p->at[l],
                                   pb + p->at[l], p->h[l], p->w[l], k);
        if (l > 0)
            metric_halve_backward(dpyr + p->at[l - 1], dpyr + p->at[l],
                                  p->h[l - 1], p->w[l - 1]);
    }
    memcpy(db, dpyr, p->h[0] * p->w[0] * sizeof *db);
}

int metric_msssim(struct metric_msssim *out, double *db, const float *a,
                  const float *b, size_t C, size_t H, size_t W,
                  struct error *err)
{
    struct pyramid p;
    struct work k = {.tmp = NULL};
    double *pa, *pb, *dpyr;
    int rc;

    if (H < METRIC_MSSSIM_MIN || W < METRIC_MSSSIM_MIN || C < 1 ||
        C > METRIC_CHANNELS)
        return error_set(err, EX_DATAERR,
                         "ms-ssim of %zux%zux%zu (expected sides of %d or "
                         "more and 1 to 4 channels)", C, H, W,
                         METRIC_MSSSIM_MIN);
    metric_pyramid_layout(&p, H, W);
    pa = arena_take(&k.memory, p.total, sizeof *pa);
    pb = arena_take(&k.memory, p.total, sizeof *pb);
    dpyr = arena_take(&k.memory, p.total, sizeof *dpyr);
    rc = metric_work_init(&k, H * W, err);
    memset(out, 0, sizeof *out);
    for (size_t c = 0; rc == 0 && c < C; c++) {
        metric_pyramid_fill(pa, &p, a + c * H * W);
        metric_pyramid_fill(pb, &p, b + c * H * W);
        metric_msssim_channel(out, db ? db + c * H * W : NULL, dpyr, pa, pb, &p,
                              c, C, &k);
    }
    arena_release(&k.memory);
    return rc;
}
