/* Resampling as PyTorch does it: grid_sample and interpolate (bilinear,
 * bicubic, antialiased), with gradients. */
#include "lib/base/resample.h"

#include <math.h>
#include <stdlib.h>

#include "lib/base/cpu.h"
#include "lib/base/resample_kernel.h"

struct kernels {
    grid_sample_fn *sample;
    grid_sample_dgrid_fn *dgrid;
    grid_sample_dx_fn *dx;
    resize_fn *forward, *backward;
};

#define KERNELS(isa) { \
    grid_sample_##isa, grid_sample_dgrid_##isa, grid_sample_dx_##isa, \
    resize_forward_##isa, resize_backward_##isa \
}

/* The versions for this processor. */
static const struct kernels *resample_kernels(void)
{
    static const struct kernels baseline = KERNELS(baseline);
#ifdef SPID_X86
    static const struct kernels avx2 = KERNELS(avx2);
    static const struct kernels avx512 = KERNELS(avx512);
#endif

    return CPU_PICK(&baseline, &avx2, &avx512);
}

void grid_sample(float *out, const float *x, const float *grid, size_t B,
                 size_t H, size_t W, size_t C, size_t N, bool align,
                 enum resample_padding pad)
{
    resample_kernels()->sample(out, x, grid, B, H, W, C, N, align,
                               pad == RESAMPLE_BORDER);
}

void grid_sample_backward(float *gx, float *ggrid, const float *gout,
                          const float *x, const float *grid, size_t B,
                          size_t H, size_t W, size_t C, size_t N, bool align,
                          enum resample_padding pad)
{
    if (ggrid)
        resample_kernels()->dgrid(ggrid, gout, x, grid, B, H, W, C, N, align,
                                  pad == RESAMPLE_BORDER);
    if (gx)
        resample_kernels()->dx(gx, gout, grid, B, H, W, C, N, align,
                               pad == RESAMPLE_BORDER);
}

/* ---- affine grids ----------------------------------------------------- */

/* Coordinate in [-1,1] of pixel i of n. */
static double resample_axis_coordinate(size_t i, size_t n, bool align)
{
    if (align)
        return n > 1 ? 2 * (double)i / ((double)n - 1) - 1 : 0;
    return (2 * (double)i + 1) / (double)n - 1;
}

void affine_grid(float *grid, const float *theta, size_t B, size_t h,
                 size_t w, bool align)
{
    for (size_t b = 0; b < B; b++, theta += 6)
        for (size_t i = 0; i < h; i++)
            for (size_t j = 0; j < w; j++, grid += 2) {
                double x = resample_axis_coordinate(j, w, align);
                double y = resample_axis_coordinate(i, h, align);

                grid[0] = (float)(theta[0] * x + theta[1] * y + theta[2]);
                grid[1] = (float)(theta[3] * x + theta[4] * y + theta[5]);
            }
}

void affine_grid_backward(float *gtheta, const float *ggrid, size_t B,
                          size_t h, size_t w, bool align)
{
    for (size_t b = 0; b < B; b++, gtheta += 6) {
        double s[6] = {0};

        for (size_t i = 0; i < h; i++)
            for (size_t j = 0; j < w; j++, ggrid += 2) {
                double x = resample_axis_coordinate(j, w, align);
                double y = resample_axis_coordinate(i, h, align);

                for (int k = 0; k < 2; k++) {
                    s[3 * k] += ggrid[k] * x;
                    s[3 * k + 1] += ggrid[k] * y;
                    s[3 * k + 2] += ggrid[k];
                }
            }
        for (int k = 0; k < 6; k++)
            gtheta[k] += (float)s[k];
    }
}

/* ---- resizing --------------------------------------------------------- */

struct resize {
    struct resize_axis x, y;
};

/* Into 0 .. n - 1. */
static int32_t resample_clamp_index(double i, size_t n)
{
    return (int32_t)(i < 0 ? 0 : i > (double)n - 1 ? (double)n - 1 : i);
}

/* The cubic convolution kernel, A = -0.75, at distance t. */
static double resample_axis_cubic(double t)
{
    const double A = -0.75;

    t = fabs(t);
    if (t <= 1)
        return ((A + 2) * t - (A + 3)) * t * t + 1;
    if (t < 2)
        return ((A * t - 5 * A) * t + 8 * A) * t - 4 * A;
    return 0;
}

/* Place of output i among n inputs, m outputs; factor 0: m / n. */
static double resample_axis_source(enum resize_kind kind, size_t i, size_t n,
                                   size_t m, double factor)
{
    double ratio = factor > 0 ? 1 / factor : (double)n / (double)m, p;

    if (kind == RESIZE_ALIGNED)
        return m > 1 ? (double)i * ((double)n - 1) / ((double)m - 1) : 0;
    p = ((double)i + 0.5) * ratio - 0.5;
    return kind == RESIZE_BILINEAR && p < 0 ? 0 : p;
}

/* Taps and weights of output i: a triangle as wide as the step. */
static void resample_axis_antialias(struct resize_axis *a, size_t i)
{
    const double s = (double)a->in / (double)a->out;
    const double support = s > 1 ? s : 1, c = s * ((double)i + 0.5);
    double first = floor(c - support + 0.5), end = floor(c + support + 0.5);
    double sum = 0;
    size_t lo = first > 0 ? (size_t)first : 0;
    size_t hi = end < (double)a->in ? (size_t)end : a->in;

    for (size_t k = 0; k < a->taps; k++) {
        size_t j = lo + k;
        double w = j < hi
            ? 1 - fabs(((double)j - c + 0.5) / support) : 0;

        a->at[i * a->taps + k] = resample_clamp_index((double)j, a->in);
        a->weight[i * a->taps + k] = (float)(w > 0 ? w : 0);
        sum += w > 0 ? w : 0;
    }
    for (size_t k = 0; k < a->taps; k++)
        a->weight[i * a->taps + k]
            = (float)(a->weight[i * a->taps + k] / sum);
}

/* Taps and weights of output i: two, or four of the cubic. */
static void resample_axis_interpolate(struct resize_axis *a, size_t i,
                                      enum resize_kind kind, double factor)
{
    const double p = resample_axis_source(kind, i, a->in, a->out, factor),
                 f = floor(p);
    int32_t *at = a->at + i * a->taps;
    float *w = a->weight + i * a->taps;

    if (kind == RESIZE_BICUBIC) {
        for (int k = 0; k < 4; k++) {
            at[k] = resample_clamp_index(f + k - 1, a->in);
            w[k] = (float)resample_axis_cubic(p - f - k + 1);
        }
    } else {
        at[0] = resample_clamp_index(f, a->in);
        at[1] = resample_clamp_index(f + 1, a->in);
        w[1] = (float)(p - f);
        w[0] = (float)(1 - (p - f));
    }
}

/* All taps of one axis, n inputs to m outputs. */
static int resample_axis_init(struct resize_axis *a, enum resize_kind kind,
                              size_t n, size_t m, double factor)
{
    a->in = n;
    a->out = m;
    a->taps = kind == RESIZE_BICUBIC ? 4 : 2;
    if (kind == RESIZE_ANTIALIAS)
        a->taps = 2 * (size_t)ceil(n > m ? (double)n / (double)m : 1) + 1;
    a->at = calloc(m * a->taps, sizeof *a->at);
    a->weight = calloc(m * a->taps, sizeof *a->weight);
    if (!a->at || !a->weight)
        return -1;
    for (size_t i = 0; i < m; i++)
        if (kind == RESIZE_ANTIALIAS)
            resample_axis_antialias(a, i);
        else
            resample_axis_interpolate(a, i, kind, factor);
    return 0;
}

struct resize *resize_plan(enum resize_kind kind, size_t H, size_t W,
                           size_t h, size_t w, double scale_y,
                           double scale_x)
{
    struct resize *r = calloc(1, sizeof *r);

    if (r && (resample_axis_init(&r->x, kind, W, w, scale_x) != 0
              || resample_axis_init(&r->y, kind, H, h, scale_y) != 0)) {
        resize_release(r);
        r = NULL;
    }
    return r;
}

void resize_release(struct resize *r)
{
    if (!r)
        return;
    free(r->x.at);
    free(r->x.weight);
    free(r->y.at);
    free(r->y.weight);
    free(r);
}

size_t resize_scratch(const struct resize *r, size_t C)
{
    return r->y.in * r->x.out * C;
}

void resize_forward(const struct resize *r, float *out, const float *x,
                    size_t B, size_t C, float *tmp)
{
    for (size_t b = 0; b < B; b++)
        resample_kernels()->forward(out + b * r->y.out * r->x.out * C,
                                    x + b * r->y.in * r->x.in * C, &r->x, &r->y,
                                    C, tmp);
}

void resize_backward(const struct resize *r, float *gx, const float *gout,
                     size_t B, size_t C, float *tmp)
{
    for (size_t b = 0; b < B; b++)
        resample_kernels()->backward(gx + b * r->y.in * r->x.in * C,
                                     gout + b * r->y.out * r->x.out * C, &r->x,
                                     &r->y, C, tmp);
}
