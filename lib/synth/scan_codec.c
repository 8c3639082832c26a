/* Cosine transforms of blocks, quantised, and their edges evened out. */
#include "lib/synth/scan_codec.h"

#include <math.h>
#include <string.h>

#define BLOCK 8


static void make_basis(float c[BLOCK * BLOCK])
{
    for (int i = 0; i < BLOCK; i++)
        for (int j = 0; j < BLOCK; j++)
            c[BLOCK * i + j] = (i ? 0.5f : 0.35355339f)
                               * cosf((2 * (float)j + 1) * (float)i
                                      * 0.19634954f);
}

/* b = C a C^T (forward) or C^T a C. */
static void codec_transform(float b[64], const float a[64], const float c[64],
                            int forward)
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

/* A plane (n,n) through quantised blocks; step is that of the slowest
 * frequencies. */
static void codec_quantise(float *p, int n, float step)
{
    float c[64], a[64], b[64];

    make_basis(c);
    for (int y = 0; y < n; y += BLOCK)
        for (int x = 0; x < n; x += BLOCK) {
            for (int i = 0; i < 64; i++) {
                int u = x + i % 8, v = y + i / 8;
                a[i] = p[(v < n ? v : n - 1) * n + (u < n ? u : n - 1)];
            }
            codec_transform(b, a, c, 1);
            for (int i = 0; i < 64; i++) {
                float s = step * (1 + 0.10f * (float)(i % 8 + i / 8));
                float l = fabsf(b[i]) / s;
                /* a dead zone: what is small is not worth its bits */
                l = i ? floorf(l + 0.30f) : rintf(l);
                b[i] = copysignf(l * s, b[i]);
            }
            codec_transform(a, b, c, 0);
            for (int i = 0; i < 64; i++)
                if (x + i % 8 < n && y + i / 8 < n)
                    p[(y + i / 8) * n + x + i % 8] = a[i];
        }
}

/* The four values about a border, at p, p + d, ...: a step smaller than the
 * limit is a fault of the blocks, and goes. */
static void codec_mend(float *p, int d, float limit)
{
    float step = p[2 * d] - p[d];

    if (fabsf(step) > limit)
        return;
    p[0] += 0.125f * step;
    p[d] += 0.375f * step;
    p[2 * d] -= 0.375f * step;
    p[3 * d] -= 0.125f * step;
}

static void codec_deblock(float *p, int n, float limit)
{
    for (int y = 0; y < n; y++)
        for (int x = BLOCK; x + 2 <= n; x += BLOCK)
            codec_mend(p + y * n + x - 2, 1, limit);
    for (int y = BLOCK; y + 2 <= n; y += BLOCK)
        for (int x = 0; x < n; x++)
            codec_mend(p + (y - 2) * n + x, n, limit);
}

static uint8_t byte_of(float v)
{
    return (uint8_t)(v < 0 ? 0 : v > 255 ? 255 : v + 0.5f);
}

void codec_damage(uint8_t *rgb, float *scratch, int n, int q)
{
    int m = (n + 1) / 2;
    /* H.264's step doubles every six quantisers; 0.625 at 0 */
    float step = 0.625f * exp2f((float)q / 6) * 1.6f;
    float *luma = scratch, *cb = luma + n * n, *cr = cb + m * m;

    memset(cb, 0, 2 * (size_t)(m * m) * sizeof *cb);
    for (int i = 0; i < n * n; i++) {
        const uint8_t *p = rgb + 3 * i;
        float y = 0.299f * p[0] + 0.587f * p[1] + 0.114f * p[2];
        int at = (i / n / 2) * m + i % n / 2;
        int wide = i % n + 1 < n || n % 2 == 0 ? 2 : 1;
        int tall = i / n + 1 < n || n % 2 == 0 ? 2 : 1;
        luma[i] = y - 128;
        cb[at] += 0.564f * ((float)p[2] - y) / (float)(wide * tall);
        cr[at] += 0.713f * ((float)p[0] - y) / (float)(wide * tall);
    }
    codec_quantise(luma, n, step);
    codec_deblock(luma, n, 2.0f * step);
    codec_quantise(cb, m, step);
    codec_quantise(cr, m, step);
    for (int i = 0; i < n * n; i++) {
        int at = (i / n / 2) * m + i % n / 2;
        float y = luma[i] + 128, b = cb[at], r = cr[at];
        rgb[3 * i] = byte_of(y + 1.402f * r);
        rgb[3 * i + 1] = byte_of(y - 0.344f * b - 0.714f * r);
        rgb[3 * i + 2] = byte_of(y + 1.772f * b);
    }
}
