/* Planes and blocks of lossy codecs (blocks.h). */
#include "lib/lab/people/blocks.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#define BLOCK 8

/* ---- planes ------------------------------------------------------------- */

struct blocks blocks_split(float *scratch, const uint8_t *rgb, int n)
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

void blocks_join(uint8_t *rgb, const struct blocks *b)
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

void blocks_quantise(float *plane, int n,
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
