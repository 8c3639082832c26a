/* SSIM's Gaussian window, and the separable filter's version for this
 * processor. */
#include "lib/lab/eval/filter.h"

#include "lib/base/cpu.h"

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

void metric_blur(double *out, const double *in, size_t H, size_t W,
                 double *tmp)
{
    CPU_PICK(metric_blur)(out, in, H, W, tmp);
}

void metric_blur_transpose(double *out, const double *in, size_t H, size_t W,
                           double *tmp)
{
    CPU_PICK(metric_blur_transpose)(out, in, H, W, tmp);
}
