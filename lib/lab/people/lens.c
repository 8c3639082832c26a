/* Blur, motion, coarse cells and noise, plane by plane. */
#include "lib/lab/people/lens.h"

#include <math.h>
#include <string.h>

#include "lib/base/vec3.h"

#define BLUR_MAX 16             /* the widest blur's, pixels to a side */
#define SMEAR_MAX 11            /* samples along a motion */

/* The weights w (2 r + 1) of a blur by a Gaussian of sigma pixels, which sum
 * to 1; returns r, 1 to BLUR_MAX. */
static int lens_blur_weights(float *w, float sigma)
{
    int r = (int)ceilf(2.5f * sigma);
    float sum = 0;

    r = r < 1 ? 1 : r > BLUR_MAX ? BLUR_MAX : r;
    for (int i = -r; i <= r; i++)
        sum += w[i + r] = expf(-0.5f * (float)(i * i) / (sigma * sigma));
    for (int i = 0; i <= 2 * r; i++)
        w[i] /= sum;
    return r;
}

/* One pixel of a row blurred across: ends are repeated. */
static float lens_soften_end(const float *row, int x, int n, const float *w,
                             int r)
{
    float v = 0;

    for (int i = -r; i <= r; i++)
        v += w[i + r] * row[x + i < 0 ? 0 : x + i >= n ? n - 1 : x + i];
    return v;
}

void lens_soften(float *img, float *tmp, int n, float sigma)
{
    float w[2 * BLUR_MAX + 1];
    const int r = lens_blur_weights(w, sigma);
    const int edge = r < (n + 1) / 2 ? r : (n + 1) / 2;

    for (int y = 0; y < n; y++) {                       /* across */
        const float *from = img + n * y;
        float *to = tmp + n * y;

        for (int x = 0; x < edge; x++) {
            to[x] = lens_soften_end(from, x, n, w, r);
            to[n - 1 - x] = lens_soften_end(from, n - 1 - x, n, w, r);
        }
        for (int x = edge; x < n - edge; x++)
            to[x] = 0;
        for (int i = -r; i <= r; i++)
            for (int x = edge; x < n - edge; x++)
                to[x] += w[i + r] * from[x + i];
    }
    for (int y = 0; y < n; y++) {                       /* down */
        memset(img + n * y, 0, (size_t)n * sizeof *img);
        for (int i = -r; i <= r; i++) {
            int v = y + i < 0 ? 0 : y + i >= n ? n - 1 : y + i;
            for (int x = 0; x < n; x++)
                img[n * y + x] += w[i + r] * tmp[n * v + x];
        }
    }
}

/* Row i of img (n,n), or the nearest that there is. */
static const float *lens_row(const float *img, int i, int n)
{
    return img + (i < 0 ? 0 : i < n ? i : n - 1) * n;
}

/* The mean of 2 r + 1 rows; the sums of all columns go down side by side. */
static void lens_box_down(float *out, const float *in, int n, int r)
{
    float sum[LENS_BOX] = {0}, w = 1 / (float)(2 * r + 1);

    for (int i = -r; i <= r; i++)
        for (int j = 0; j < n; j++)
            sum[j] += lens_row(in, i, n)[j];
    for (int i = 0; i < n; i++) {
        const float *next = lens_row(in, i + r + 1, n);
        const float *last = lens_row(in, i - r, n);

        for (int j = 0; j < n; j++) {
            out[i * n + j] = sum[j] * w;
            sum[j] += next[j] - last[j];
        }
    }
}

/* Rows become columns. */
static void lens_turn(float *out, const float *in, int n)
{
    enum { TILE = 16 };

    for (int t = 0; t < n * n / TILE; t += TILE)
        for (int y = t / n * TILE; y < t / n * TILE + TILE; y++)
            for (int x = t % n; x < t % n + TILE; x++)
                out[x * n + y] = in[y * n + x];
}

void lens_box(float *img, float *tmp, int n, int r)
{
    for (int axis = 0; axis < 2; axis++) {      /* across, then down */
        lens_turn(tmp, img, n);
        lens_box_down(img, tmp, n, r);
        lens_box_down(tmp, img, n, r);
        memcpy(img, tmp, (size_t)(n * n) * sizeof *img);
    }
}

void lens_smear(float *img, float *tmp, int n, float dx, float dy)
{
    const size_t bytes = (size_t)(n * n) * sizeof *img;
    int taps = (int)ceilf(fmaxf(fabsf(dx), fabsf(dy))) + 1;

    taps = taps > SMEAR_MAX ? SMEAR_MAX : taps;
    memset(tmp, 0, bytes);
    for (int i = 0; i < taps; i++) {
        float t = taps > 1 ? (float)i / (float)(taps - 1) - 0.5f : 0;
        int u = (int)lrintf(t * dx), v = (int)lrintf(t * dy);
        for (int y = 0; y < n; y++)
            for (int x = 0; x < n; x++) {
                int p = x + u, q = y + v;
                p = p < 0 ? 0 : p >= n ? n - 1 : p;
                q = q < 0 ? 0 : q >= n ? n - 1 : q;
                tmp[y * n + x] += img[q * n + p] / (float)taps;
            }
    }
    memcpy(img, tmp, bytes);
}

void lens_coarsen(float *img, float *tmp, int n, float low)
{
    int m = (int)((float)n * low);

    m = m < 8 ? 8 : m;
    float step = (float)n / (float)m;
    for (int y = 0; y < m; y++)
        for (int x = 0; x < m; x++) {
            int u = (int)(((float)x + 0.25f) * step);
            int v = (int)(((float)y + 0.25f) * step);
            int u1 = (int)(((float)x + 0.75f) * step);
            int v1 = (int)(((float)y + 0.75f) * step);
            tmp[y * m + x] = 0.25f * (img[v * n + u] + img[v * n + u1]
                                      + img[v1 * n + u] + img[v1 * n + u1]);
        }
    for (int y = 0; y < n; y++)
        for (int x = 0; x < n; x++) {
            float fu = clampf(((float)x + 0.5f) / step - 0.5f, 0,
                              (float)(m - 1) - 0.001f);
            float fv = clampf(((float)y + 0.5f) / step - 0.5f, 0,
                              (float)(m - 1) - 0.001f);
            int u = (int)fu, v = (int)fv;
            const float *p = tmp + v * m + u;
            img[y * n + x] = lerpf(lerpf(p[0], p[1], fu - (float)u),
                                   lerpf(p[m], p[m + 1], fu - (float)u),
                                   fv - (float)v);
        }
}

float lens_grain(float v, int k, uint64_t h, float noise)
{
    /* sum of two bytes: close enough to a bell */
    int g = (int)(h >> (16 * k) & 255) + (int)(h >> (16 * k + 8) & 255);

    return v + noise * ((float)g - 255) * (1 / 104.0f) * (1.3f - 0.8f * v);
}
