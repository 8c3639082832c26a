/* What JPEG and low-rate video do to a picture, without their files: luma beside
 * both chromas at half the resolution (4:2:0), cosine transforms of blocks of 8
 * by 8, rounded, and for video the blocks' edges evened out. */
#include "lib/lab/people/codec.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#define BLOCK 8

/* The planes of a picture of n x n pixels, in one block of scratch (n,n,3). */
struct blocks {
    int n, m;                   /* m = (n + 1) / 2 */
    float *luma;                /* (n,n) less 128 */
    float *cb, *cr;             /* (m,m), means of two by two pixels */
};

/* ---- planes ------------------------------------------------------------- */

/* From rgb (n,n,3), BT.601. */
static struct blocks blocks_split(float *scratch, const uint8_t *rgb, int n)
{
    const int m = (n + 1) / 2;
    struct blocks b = {n, m, scratch, scratch + n * n,
                       scratch + n * n + m * m};

    memset(b.cb, 0, 2 * (size_t)(m * m) * sizeof *b.cb);
    for (int i = 0; i < n * n; i++) {
        const uint8_t *p = rgb + 3 * i;
        float y = 0.299f * p[0] + 0.587f * p[1] + 0.114f * p[2];
        int at = (i / n / 2) * m + i % n / 2;
        int wide = i % n + 1 < n || n % 2 == 0 ? 2 : 1;
        int tall = i / n + 1 < n || n % 2 == 0 ? 2 : 1;

        b.luma[i] = y - 128;
        b.cb[at] += 0.564f * ((float)p[2] - y) / (float)(wide * tall);
        b.cr[at] += 0.713f * ((float)p[0] - y) / (float)(wide * tall);
    }
    return b;
}

/* To the nearest byte. */
static uint8_t blocks_byte(float v)
{
    return (uint8_t)(v < 0 ? 0 : v > 255 ? 255 : v + 0.5f);
}

/* And back into rgb. */
static void blocks_join(uint8_t *rgb, const struct blocks *b)
{
    const int n = b->n;

    for (int i = 0; i < n * n; i++) {
        int at = (i / n / 2) * b->m + i % n / 2;
        float y = b->luma[i] + 128, u = b->cb[at], v = b->cr[at];

        rgb[3 * i] = blocks_byte(y + 1.402f * v);
        rgb[3 * i + 1] = blocks_byte(y - 0.344f * u - 0.714f * v);
        rgb[3 * i + 2] = blocks_byte(y + 1.772f * u);
    }
}

/* ---- blocks ------------------------------------------------------------- */

/* The orthonormal cosine transform (DCT-II) of eight values: C (8,8). */
static void blocks_basis(float c[64])
{
    for (int i = 0; i < BLOCK; i++)
        for (int j = 0; j < BLOCK; j++)
            c[BLOCK * i + j] = (i ? 0.5f : 0.35355339f)
                               * cosf((2 * (float)j + 1) * (float)i
                                      * 0.19634954f);
}

/* b = C a C^T (forward) or C^T a C. */
static void blocks_transform(float b[64], const float a[64], const float c[64],
                             bool forward)
{
    float t[64], m[64];

    for (int i = 0; i < 64; i++)
        m[i] = forward ? c[i] : c[8 * (i % 8) + i / 8];
    memset(t, 0, sizeof t);
    for (int i = 0; i < 8; i++)
        for (int k = 0; k < 8; k++)
            for (int j = 0; j < 8; j++)
                t[8 * i + j] += m[8 * i + k] * a[8 * k + j];
    for (int i = 0; i < 8; i++)
        for (int j = 0; j < 8; j++) {
            float sum = 0;

            for (int k = 0; k < 8; k++)
                sum += t[8 * i + k] * m[8 * j + k];
            b[8 * i + j] = sum;
        }
}

/* Give the cosine coefficients of every block of a plane (n,n), slowest first
 * in rows of eight, to quantise, and put back what it makes of them.  Blocks
 * start at multiples of 8; the last ones repeat the border. */
static void blocks_quantise(float *plane, int n,
                            void (*quantise)(float b[64], const void *ctx),
                            const void *ctx)
{
    float c[64], a[64], b[64];

    blocks_basis(c);
    for (int y = 0; y < n; y += BLOCK)
        for (int x = 0; x < n; x += BLOCK) {
            for (int i = 0; i < 64; i++) {
                int u = x + i % 8, v = y + i / 8;

                a[i] = plane[(v < n ? v : n - 1) * n + (u < n ? u : n - 1)];
            }
            blocks_transform(b, a, c, true);
            quantise(b, ctx);
            blocks_transform(a, b, c, false);
            for (int i = 0; i < 64; i++)
                if (x + i % 8 < n && y + i / 8 < n)
                    plane[(y + i / 8) * n + x + i % 8] = a[i];
        }
}

/* ---- JPEG --------------------------------------------------------------- */

/* The usual table, scaled by quality. */
static const uint8_t jpeg_luma[64] = {
    16, 11, 10, 16, 24, 40, 51, 61, 12, 12, 14, 19, 26, 58, 60, 55,
    14, 13, 16, 24, 40, 57, 69, 56, 14, 17, 22, 29, 51, 87, 80, 62,
    18, 22, 37, 56, 68, 109, 103, 77, 24, 35, 55, 64, 81, 104, 113, 92,
    49, 64, 78, 87, 103, 121, 120, 101, 72, 92, 95, 98, 112, 100, 103, 99
};

/* How a plane's coefficients are rounded. */
struct jpeg_table {
    int quality;
    bool chroma;
};

/* To multiples of the table's steps, at least 1. */
static void jpeg_round(float b[64], const void *table)
{
    const struct jpeg_table *t = table;
    int scale = t->quality < 50 ? 5000 / t->quality : 200 - 2 * t->quality;

    for (int i = 0; i < 64; i++) {
        int low = i % 8 + i / 8, base = jpeg_luma[i];

        if (t->chroma)
            base = low < 4 ? 20 + 8 * low : 99;
        float q = (float)((base * scale + 50) / 100);
        q = q < 1 ? 1 : q;
        b[i] = rintf(b[i] / q) * q;
    }
}

void jpeg_damage(uint8_t *rgb, float *scratch, int n, int quality)
{
    const struct jpeg_table luma = {quality, false}, chroma = {quality, true};
    struct blocks b = blocks_split(scratch, rgb, n);

    blocks_quantise(b.luma, n, jpeg_round, &luma);
    blocks_quantise(b.cb, b.m, jpeg_round, &chroma);
    blocks_quantise(b.cr, b.m, jpeg_round, &chroma);
    blocks_join(rgb, &b);
}

/* ---- video -------------------------------------------------------------- */

/* Round coefficients to multiples of a step (float), coarser for the finer
 * ones.  A dead zone: what is small is not worth its bits. */
static void codec_round(float b[64], const void *slowest)
{
    const float step = *(const float *)slowest;

    for (int i = 0; i < 64; i++) {
        float s = step * (1 + 0.10f * (float)(i % 8 + i / 8));
        float l = fabsf(b[i]) / s;

        l = i ? floorf(l + 0.30f) : rintf(l);
        b[i] = copysignf(l * s, b[i]);
    }
}

/* The four values about a border, at p, p + d, ...: a step smaller than the
 * limit is a fault of the blocks, and goes. */
static void codec_smooth_border(float *p, int d, float limit)
{
    float step = p[2 * d] - p[d];

    if (fabsf(step) > limit)
        return;
    p[0] += 0.125f * step;
    p[d] += 0.375f * step;
    p[2 * d] -= 0.375f * step;
    p[3 * d] -= 0.125f * step;
}

/* Across all borders of blocks, the upright ones first. */
static void codec_deblock(float *p, int n, float limit)
{
    for (int y = 0; y < n; y++)
        for (int x = BLOCK; x + 2 <= n; x += BLOCK)
            codec_smooth_border(p + y * n + x - 2, 1, limit);
    for (int y = BLOCK; y + 2 <= n; y += BLOCK)
        for (int x = 0; x < n; x++)
            codec_smooth_border(p + (y - 2) * n + x, n, limit);
}

void codec_damage(uint8_t *rgb, float *scratch, int n, int q)
{
    /* H.264's step doubles every six quantisers; 0.625 at 0 */
    const float step = 0.625f * exp2f((float)q / 6) * 1.6f;
    struct blocks b = blocks_split(scratch, rgb, n);

    blocks_quantise(b.luma, n, codec_round, &step);
    codec_deblock(b.luma, n, 2 * step);
    blocks_quantise(b.cb, b.m, codec_round, &step);
    blocks_quantise(b.cr, b.m, codec_round, &step);
    blocks_join(rgb, &b);
}
