/* L1, L2 and a Laplacian pyramid's L1 (Burt and Adelson 1983) with their
 * gradients. */
#include "lib/lab/train/losses.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

/* -1, 0 or 1. */
static float loss_sign(float x)
{
    return (float)((x > 0) - (x < 0));
}

double loss_l1(float *db, const float *b, const float *a, size_t H, size_t W,
               const struct box *box, double weight)
{
    struct box all = {0, 0, W, H};
    double sum = 0, scale;
    size_t n;

    if (!box)
        box = &all;
    n = 3 * (box->x1 - box->x0) * (box->y1 - box->y0);
    if (!n)
        return 0;
    scale = weight / (double)n;
    for (size_t y = box->y0; y < box->y1; y++)
        for (size_t i = 3 * (y * W + box->x0); i < 3 * (y * W + box->x1);
             i++) {
            float d = b[i] - a[i];
            sum += fabsf(d);
            if (db)
                db[i] += (float)scale * loss_sign(d);
        }
    return sum * scale;
}

double loss_l2(float *db, const float *b, const float *a, size_t n,
               double weight)
{
    double sum = 0, scale = n ? weight / (double)n : 0;

    for (size_t i = 0; i < n; i++) {
        float d = b[i] - a[i];
        sum += (double)d * d;
        if (db)
            db[i] += (float)(2 * scale) * d;
    }
    return sum * scale;
}

/* ---- pyramid ----------------------------------------------------------- */

/* Sizes of the levels; level l+1 is half of level l, rounded up. */
struct levels {
    int n;                          /* bands; level n is the rest */
    size_t h[LOSS_LEVELS + 1], w[LOSS_LEVELS + 1];
    size_t at[LOSS_LEVELS + 1], total;
};

/* Where each level lies in the scratch. */
static void loss_pyramid_lay_out(struct levels *l, size_t H, size_t W)
{
    l->n = 0;
    l->total = 0;
    for (int i = 0; i <= LOSS_LEVELS; i++) {
        l->h[i] = H;
        l->w[i] = W;
        l->at[i] = l->total;
        l->total += 3 * H * W;
        l->n = i;
        if (H < 2 || W < 2)
            break;
        H = (H + 1) / 2;
        W = (W + 1) / 2;
    }
}

size_t loss_pyramid_scratch(size_t H, size_t W)
{
    struct levels l;

    loss_pyramid_lay_out(&l, H, W);
    return 2 * l.total;
}

/* Taps 1 3 3 1 of pixel i of the halved axis: the four pixels it reads. */
static void loss_pyramid_taps(size_t tap[4], size_t i, size_t n)
{
    for (size_t k = 0; k < 4; k++) {
        size_t j = 2 * i + k;           /* 2i - 1 + k, shifted by one */
        tap[k] = j < 1 ? 0 : j - 1 >= n ? n - 1 : j - 1;
    }
}

static const float tap_weight[4] = {0.125f, 0.375f, 0.375f, 0.125f};

/* small = the picture halved; or, back set, big += its transpose. */
static void loss_pyramid_halve(float *small, float *big, size_t H, size_t W,
                               bool back)
{
    size_t h = (H + 1) / 2, w = (W + 1) / 2, ty[4], tx[4];

    for (size_t y = 0; y < h; y++) {
        loss_pyramid_taps(ty, y, H);
        for (size_t x = 0; x < w; x++) {
            float *s = small + 3 * (y * w + x), v[3] = {0, 0, 0};
            loss_pyramid_taps(tx, x, W);
            for (int k = 0; k < 16; k++) {
                float *p = big + 3 * (ty[k / 4] * W + tx[k % 4]);
                float t = tap_weight[k / 4] * tap_weight[k % 4];
                for (int c = 0; c < 3; c++) {
                    if (back)
                        p[c] += t * s[c];
                    else
                        v[c] += t * p[c];
                }
            }
            if (!back)
                memcpy(s, v, sizeof v);
        }
    }
}

/* big -= the small picture doubled (bilinear); or, back set, small -= the
 * transpose of that. */
static void loss_pyramid_double(float *big, float *small, size_t H, size_t W,
                                bool back)
{
    size_t h = (H + 1) / 2, w = (W + 1) / 2;

    for (size_t y = 0; y < H; y++) {
        size_t y1 = y % 2 ? (y / 2 + 1 < h ? y / 2 + 1 : h - 1)
                          : (y / 2 > 0 ? y / 2 - 1 : 0);
        for (size_t x = 0; x < W; x++) {
            size_t x1 = x % 2 ? (x / 2 + 1 < w ? x / 2 + 1 : w - 1)
                              : (x / 2 > 0 ? x / 2 - 1 : 0);
            float *b = big + 3 * (y * W + x);
            float *s[4] = {small + 3 * (y / 2 * w + x / 2),
                           small + 3 * (y / 2 * w + x1),
                           small + 3 * (y1 * w + x / 2),
                           small + 3 * (y1 * w + x1)};
            static const float t[4] = {0.5625f, 0.1875f, 0.1875f, 0.0625f};
            for (int k = 0; k < 4; k++)
                for (int c = 0; c < 3; c++) {
                    if (back)
                        s[k][c] -= t[k] * b[c];
                    else
                        b[c] -= t[k] * s[k][c];
                }
        }
    }
}

/* Sum of |x|; x becomes scale * sign(x), the gradient. */
static double loss_pyramid_absolute(float *x, size_t n, double scale)
{
    double sum = 0;

    for (size_t i = 0; i < n; i++) {
        sum += fabsf(x[i]);
        x[i] = (float)scale * loss_sign(x[i]);
    }
    return sum * scale;
}

/* Down: band i = low i - doubled low i+1; low 0 is there. */
static void loss_pyramid_bands(float *band, float *low, const struct levels *l)
{
    for (int i = 0; i < l->n; i++) {
        loss_pyramid_halve(low + l->at[i + 1], low + l->at[i], l->h[i],
                           l->w[i], false);
        memcpy(band + l->at[i], low + l->at[i],
               3 * l->h[i] * l->w[i] * sizeof *band);
        loss_pyramid_double(band + l->at[i], low + l->at[i + 1], l->h[i],
                            l->w[i], false);
    }
    memcpy(band + l->at[l->n], low + l->at[l->n],
           3 * l->h[l->n] * l->w[l->n] * sizeof *band);
}

/* Up: band becomes the gradient of low. */
static void loss_pyramid_bands_backward(float *band, const struct levels *l)
{
    for (int i = l->n - 1; i >= 0; i--) {
        loss_pyramid_double(band + l->at[i], band + l->at[i + 1], l->h[i],
                            l->w[i], true);
        loss_pyramid_halve(band + l->at[i + 1], band + l->at[i], l->h[i],
                           l->w[i], true);
    }
}

double loss_pyramid(float *db, const float *b, const float *a, size_t H,
                    size_t W, const struct box *box, double weight,
                    float *tmp)
{
    struct box all = {0, 0, W, H};
    struct levels l;
    double loss = 0;
    float *band = tmp, *low;

    if (!box)
        box = &all;
    if (box->x1 <= box->x0 || box->y1 <= box->y0)
        return 0;
    loss_pyramid_lay_out(&l, box->y1 - box->y0, box->x1 - box->x0);
    low = tmp + l.total;
    for (size_t y = 0, k = 0; y < l.h[0]; y++)
        for (size_t i = 3 * ((box->y0 + y) * W + box->x0), e = i + 3 * l.w[0];
             i < e; i++)
            low[k++] = b[i] - a[i];
    loss_pyramid_bands(band, low, &l);
    for (int i = 0; i <= l.n; i++) {
        size_t n = 3 * l.h[i] * l.w[i];
        loss += loss_pyramid_absolute(band + l.at[i], n, weight / (double)n);
    }
    loss_pyramid_bands_backward(band, &l);
    for (size_t y = 0, k = 0; db && y < l.h[0]; y++)
        for (size_t i = 3 * ((box->y0 + y) * W + box->x0), e = i + 3 * l.w[0];
             i < e; i++)
            db[i] += band[k++];
    return loss;
}
