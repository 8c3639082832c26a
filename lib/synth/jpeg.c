/* JPEG's damage without its file: colour transform, cosine blocks, rounding
 * to the usual tables scaled by quality, and back. */
#include "lib/synth/lens.h"

#include <math.h>

static const uint8_t luma_table[64] = {
    16, 11, 10, 16, 24, 40, 51, 61, 12, 12, 14, 19, 26, 58, 60, 55,
    14, 13, 16, 24, 40, 57, 69, 56, 14, 17, 22, 29, 51, 87, 80, 62,
    18, 22, 37, 56, 68, 109, 103, 77, 24, 35, 55, 64, 81, 104, 113, 92,
    49, 64, 78, 87, 103, 121, 120, 101, 72, 92, 95, 98, 112, 100, 103, 99
};

/* b = C a C^T (forward) or C^T a C of an 8x8 block. */
static void jpeg_cosine(float b[64], const float a[64], const float c[64],
                        int forward)
{
    float t[64];
    for (int i = 0; i < 8; i++)
        for (int j = 0; j < 8; j++) {
            float sum = 0;
            for (int k = 0; k < 8; k++)
                sum += (forward ? c[8 * i + k] : c[8 * k + i]) * a[8 * k + j];
            t[8 * i + j] = sum;
        }
    for (int i = 0; i < 8; i++)
        for (int j = 0; j < 8; j++) {
            float sum = 0;
            for (int k = 0; k < 8; k++)
                sum += t[8 * i + k] * (forward ? c[8 * j + k] : c[8 * k + j]);
            b[8 * i + j] = sum;
        }
}

/* Round the cosine coefficients of plane (n,n), whose blocks start at
 * multiples of 8; the last ones repeat the border. */
static void round_plane(float *plane, int n, int quality, int chroma)
{
    float c[64], a[64], b[64];
    int scale = quality < 50 ? 5000 / quality : 200 - 2 * quality;
    for (int i = 0; i < 8; i++)
        for (int j = 0; j < 8; j++)
            c[8 * i + j] = (i ? 0.5f : 0.35355339f)
                           * cosf((2 * (float)j + 1) * (float)i * 0.19634954f);
    for (int y = 0; y < n; y += 8)
        for (int x = 0; x < n; x += 8) {
            for (int i = 0; i < 64; i++) {
                int u = x + i % 8, v = y + i / 8;
                u = u < n ? u : n - 1;
                v = v < n ? v : n - 1;
                a[i] = plane[v * n + u];
            }
            jpeg_cosine(b, a, c, 1);
            for (int i = 0; i < 64; i++) {
                int low = i % 8 + i / 8, base = luma_table[i];
                if (chroma)
                    base = low < 4 ? 20 + 8 * low : 99;
                float q = (float)((base * scale + 50) / 100);
                q = q < 1 ? 1 : q;
                b[i] = rintf(b[i] / q) * q;
            }
            jpeg_cosine(a, b, c, 0);
            for (int i = 0; i < 64; i++)
                if (x + i % 8 < n && y + i / 8 < n)
                    plane[(y + i / 8) * n + x + i % 8] = a[i];
        }
}

static uint8_t jpeg_byte(float v)
{
    return (uint8_t)(v < 0 ? 0 : v > 255 ? 255 : v + 0.5f);
}

void jpeg_damage(uint8_t *rgb, float *scratch, int n, int quality)
{
    int m = (n + 1) / 2;
    float *luma = scratch, *cb = luma + n * n, *cr = cb + m * m;
    for (int i = 0; i < 2 * m * m; i++)
        cb[i] = 0;
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
    round_plane(luma, n, quality, 0);
    round_plane(cb, m, quality, 1);
    round_plane(cr, m, quality, 1);
    for (int i = 0; i < n * n; i++) {
        int at = (i / n / 2) * m + i % n / 2;
        float y = luma[i] + 128, b = cb[at], r = cr[at];
        rgb[3 * i] = jpeg_byte(y + 1.402f * r);
        rgb[3 * i + 1] = jpeg_byte(y - 0.344f * b - 0.714f * r);
        rgb[3 * i + 2] = jpeg_byte(y + 1.772f * b);
    }
}
