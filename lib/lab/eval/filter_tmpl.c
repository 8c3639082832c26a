/* Blur kernels: rows are contiguous, so that the inner loops vectorise. */
#include "lib/lab/eval/filter.h"

#include <string.h>

/* y[0..n) += a * x[0..n) */
static void filter_axpy(double *restrict y, const double *restrict x, double a,
                        size_t n)
{
    for (size_t i = 0; i < n; i++)
        y[i] += a * x[i];
}

/* Rows, then columns: tmp (H,w) between them. */
void ISA(metric_blur)(double *out, const double *in, size_t H, size_t W,
                      double *tmp)
{
    size_t w = W - METRIC_WINDOW + 1, h = H - METRIC_WINDOW + 1;

    memset(tmp, 0, H * w * sizeof *tmp);
    for (size_t y = 0; y < H; y++)
        for (size_t k = 0; k < METRIC_WINDOW; k++)
            filter_axpy(tmp + y * w, in + y * W + k, metric_taps[k], w);
    memset(out, 0, h * w * sizeof *out);
    for (size_t y = 0; y < h; y++)
        for (size_t k = 0; k < METRIC_WINDOW; k++)
            filter_axpy(out + y * w, tmp + (y + k) * w, metric_taps[k], w);
}

/* The transpose of metric_blur, for gradients: columns, then rows. */
void ISA(metric_blur_transpose)(double *out, const double *in, size_t H,
                                size_t W, double *tmp)
{
    size_t w = W - METRIC_WINDOW + 1, h = H - METRIC_WINDOW + 1;

    memset(tmp, 0, H * w * sizeof *tmp);
    for (size_t y = 0; y < h; y++)
        for (size_t k = 0; k < METRIC_WINDOW; k++)
            filter_axpy(tmp + (y + k) * w, in + y * w, metric_taps[k], w);
    memset(out, 0, H * W * sizeof *out);
    for (size_t y = 0; y < H; y++)
        for (size_t k = 0; k < METRIC_WINDOW; k++)
            filter_axpy(out + y * W + k, tmp + y * w, metric_taps[k], w);
}
