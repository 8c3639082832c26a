/* SSIM's Gaussian window, and the separable filter's version for this
 * processor. */
#include "lib/lab/eval/filter.h"

#include "lib/base/cpu.h"
#include "lib/base/isa.h"

/* exp(-(i-5)^2 / 4.5), normalised to sum 1. */
const double metric_taps[METRIC_WINDOW] = {
    0.0010283800844791101,
    0.007598758135239185,
    0.036000772128430829,
    0.10936068950970002,
    0.21300553771125369,
    0.26601172486179436,
    0.21300553771125369,
    0.10936068950970002,
    0.036000772128430829,
    0.007598758135239185,
    0.0010283800844791101
};

typedef void filter_fn(double *, const double *, size_t, size_t, double *);

filter_fn metric_blur_baseline, metric_blur_transpose_baseline;
#ifdef SPID_X86
filter_fn metric_blur_avx2, metric_blur_avx512;
filter_fn metric_blur_transpose_avx2, metric_blur_transpose_avx512;
static filter_fn *const blur[] = {metric_blur_baseline, metric_blur_avx2,
                                  metric_blur_avx512};
static filter_fn *const transpose[] = {metric_blur_transpose_baseline,
                                       metric_blur_transpose_avx2,
                                       metric_blur_transpose_avx512};
#else
static filter_fn *const blur[] = {metric_blur_baseline};
static filter_fn *const transpose[] = {metric_blur_transpose_baseline};
#endif

void metric_blur(double *out, const double *in, size_t H, size_t W,
                 double *tmp)
{
    blur[cpu_level()](out, in, H, W, tmp);
}

void metric_blur_transpose(double *out, const double *in, size_t H, size_t W,
                           double *tmp)
{
    transpose[cpu_level()](out, in, H, W, tmp);
}
