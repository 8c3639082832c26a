/* The 11-tap Gaussian window of SSIM, valid region only, in double. */
#ifndef SPID_LAB_EVAL_FILTER_H
#define SPID_LAB_EVAL_FILTER_H

#include <stddef.h>

#include "lib/base/isa.h"

#define METRIC_WINDOW 11 /* taps; the standard deviation is 1.5 */

/* The normalised taps. */
extern const double metric_taps[METRIC_WINDOW];

/* Separable blur of in [H,W] to out [H-10,W-10]; tmp has room for H*(W-10)
 * values.  H and W are at least 11. */
void metric_blur(double *out, const double *in, size_t H, size_t W,
                 double *tmp);

/* Transpose of metric_blur: in [H-10,W-10] is spread to out [H,W], which is
 * overwritten; tmp as above. */
void metric_blur_transpose(double *out, const double *in, size_t H, size_t W,
                           double *tmp);

/* Both, a version for each instruction set. */
typedef void metric_blur_fn(double *out, const double *in, size_t H, size_t W,
                            double *tmp);
ISA_VERSIONS(metric_blur_fn, metric_blur);
ISA_VERSIONS(metric_blur_fn, metric_blur_transpose);

#endif
