/* The inner loops of resample.c, compiled once per instruction set. */
#include "lib/base/parallel.h"
#include "lib/base/quad.h"
#include "lib/base/resample_kernel.h"

#include <math.h>

/* The four taps of a grid position: index (in pixels, -1: outside) and
 * weight; and the weights' derivative by x and y in pixels. */
struct taps {
    ptrdiff_t at[4];
    float w[4], dx[4], dy[4];
};

/* Unnormalised position of a coordinate in [-1,1]; *slope is its derivative
 * by the coordinate, 0 where padding holds it. */
static inline double resample_grid_position(float g, size_t n, bool align,
                                            bool border, double *slope)
{
    double p;

    if (align) {
        p = ((double)g + 1) * 0.5 * ((double)n - 1);
        *slope = 0.5 * ((double)n - 1);
    } else {
        p = (((double)g + 1) * (double)n - 1) * 0.5;
        *slope = 0.5 * (double)n;
    }
    if (!(p > -1e9 && p < 1e9)) {      /* NaN or absurd: the far outside */
        p = p > 0 ? 1e9 : -1e9;
        *slope = 0;
    }
    if (border) {
        double end = (double)n - 1;

        if (p <= 0 || p >= end)
            *slope = 0;
        p = p < 0 ? 0 : p > end ? end : p;
    }
    return p;
}

/* Index of a pixel, -1 outside of the picture. */
static inline ptrdiff_t resample_grid_tap(ptrdiff_t x, ptrdiff_t y, size_t W,
                                          size_t H)
{
    if (x < 0 || y < 0 || x >= (ptrdiff_t)W || y >= (ptrdiff_t)H)
        return -1;
    return y * (ptrdiff_t)W + x;
}

/* Four pixels around a grid point, their weights, and the weights' slopes. */
static inline void resample_grid_taps(struct taps *t, double slope[2],
                                      const float *g, size_t W, size_t H,
                                      bool align, bool border)
{
    double px = resample_grid_position(g[0], W, align, border, slope);
    double py = resample_grid_position(g[1], H, align, border, slope + 1);
    double fx = floor(px), fy = floor(py);
    float a = (float)(px - fx), b = (float)(py - fy);
    ptrdiff_t x = (ptrdiff_t)fx, y = (ptrdiff_t)fy;

    for (int k = 0; k < 4; k++) {
        float wx = k & 1 ? a : 1 - a, wy = k & 2 ? b : 1 - b;

        t->at[k] = resample_grid_tap(x + (k & 1), y + (k >> 1), W, H);
        t->w[k] = wx * wy;
        t->dx[k] = k & 1 ? wy : -wy;
        t->dy[k] = k & 2 ? wx : -wx;
    }
}

#define FEW 65536              /* numbers that one thread writes by itself */

/* o (C): what lies at place g (2) of picture x (H,W,C). */
static inline void resample_grid_point(float *o, const float *x,
                                       const float *g, size_t H, size_t W,
                                       size_t C, bool align, bool border)
{
    struct taps t;
    double slope[2];
    size_t c = 0;

    resample_grid_taps(&t, slope, g, W, H, align, border);
    for (; c + 4 <= C; c += 4) {
        quad sum = {0};

        for (int k = 0; k < 4; k++)
            if (t.at[k] >= 0)
                sum += t.w[k] * *(const quad *)(x + (size_t)t.at[k] * C + c);
        *(quad *)(o + c) = sum;
    }
    for (; c < C; c++) {
        float sum = 0;

        for (int k = 0; k < 4; k++)
            if (t.at[k] >= 0)
                sum += t.w[k] * x[(size_t)t.at[k] * C + c];
        o[c] = sum;
    }
}

/* Items that one thread does by itself, of all numbers over `count` items. */
static inline size_t resample_grain(size_t count, size_t C)
{
    return count * C > FEW ? 1 : count;
}

/* Point i. */
PARALLEL(resample_forward, i, float *, out, const float *, x, const float *,
         grid, size_t, H, size_t, W, size_t, C, size_t, N, bool, align,
         bool, border)
{
    resample_grid_point(out + i * C, x + i / N * H * W * C, grid + 2 * i, H, W,
                        C, align, border);
}

/* out (B,N,C): the picture at each point, 0 outside. */
static void resample_sample(float *out, const float *x, const float *grid,
                            size_t B, size_t H, size_t W, size_t C, size_t N,
                            bool align, bool border)
{
    parallel_each(resample_forward, B * N, resample_grain(B * N, C), out, x,
                  grid, H, W, C, N, align, border);
}

/* in the forward pass this was: o[c] += w(grid) * p[c] */
PARALLEL(resample_backward_grid, i, float *, ggrid, const float *, gout,
         const float *, x, const float *, grid, size_t, H, size_t, W, size_t,
         C, size_t, N, bool, align, bool, border)
{
    const float *xb = x + i / N * H * W * C;
    const float *g = gout + i * C;
    struct taps t;
    double slope[2], sx = 0, sy = 0;

    resample_grid_taps(&t, slope, grid + 2 * i, W, H, align, border);
    for (int k = 0; k < 4; k++) {
        const float *p = xb + (size_t)t.at[k] * C;
        float dot = 0;

        if (t.at[k] < 0)
            continue;
        for (size_t n = 0; n < C; n++)
            dot += g[n] * p[n];
        sx += (double)t.dx[k] * dot;
        sy += (double)t.dy[k] * dot;
    }
    ggrid[2 * i] += (float)(sx * slope[0]);
    ggrid[2 * i + 1] += (float)(sy * slope[1]);
}

static void resample_dgrid(float *ggrid, const float *gout, const float *x,
                           const float *grid, size_t B, size_t H, size_t W,
                           size_t C, size_t N, bool align, bool border)
{
    parallel_each(resample_backward_grid, B * N, resample_grain(B * N, C),
                  ggrid, gout, x, grid, H, W, C, N, align, border);
}

#define SLICE 16               /* channels a thread adds to */

/* Slice j of all pictures' channels. */
PARALLEL(resample_backward_x, j, float *, gx, const float *, gout,
         const float *, grid, size_t, H, size_t, W, size_t, C, size_t, N,
         bool, align, bool, border)
{
    const size_t slices = (C + SLICE - 1) / SLICE;
    const size_t b = j / slices, c0 = j % slices * SLICE;
    const size_t n = C - c0 < SLICE ? C - c0 : SLICE;
    float *xb = gx + b * H * W * C + c0;

    for (size_t i = b * N; i < (b + 1) * N; i++) {
        const float *g = gout + i * C + c0;
        struct taps t;
        double slope[2];

        resample_grid_taps(&t, slope, grid + 2 * i, W, H, align, border);
        for (int k = 0; k < 4; k++) {
            float *p = xb + (size_t)t.at[k] * C, w = t.w[k];

            if (t.at[k] < 0)
                continue;
            for (size_t m = 0; m < n; m++)
                p[m] += w * g[m];
        }
    }
}

/* Each thread adds into its own channels of one picture. */
static void resample_dx(float *gx, const float *gout, const float *grid,
                        size_t B, size_t H, size_t W, size_t C, size_t N,
                        bool align, bool border)
{
    const size_t slices = B * ((C + SLICE - 1) / SLICE);

    parallel_each(resample_backward_x, slices, B * N * C > FEW ? 1 : slices,
                  gx, gout, grid, H, W, C, N, align, border);
}

const struct grid_kernels ISA(grid_kernels) = {
    resample_sample, resample_dgrid, resample_dx
};
