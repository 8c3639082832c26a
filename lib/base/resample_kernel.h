/* The inner loops of lib/base/resample.h, one version per instruction set. */
#ifndef SPID_BASE_RESAMPLE_KERNEL_H
#define SPID_BASE_RESAMPLE_KERNEL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/isa.h"

/* One axis of a resize: output i is the sum over k of
 * weight[i taps + k] * input[at[i taps + k]]. */
struct resize_axis {
    size_t in, out, taps;
    int32_t *at;
    float *weight;
};

typedef void grid_sample_fn(float *out, const float *x, const float *grid,
                            size_t B, size_t H, size_t W, size_t C, size_t N,
                            bool align, bool border);
typedef void grid_sample_dgrid_fn(float *ggrid, const float *gout,
                                  const float *x, const float *grid, size_t B,
                                  size_t H, size_t W, size_t C, size_t N,
                                  bool align, bool border);
typedef void grid_sample_dx_fn(float *gx, const float *gout,
                               const float *grid, size_t B, size_t H,
                               size_t W, size_t C, size_t N, bool align,
                               bool border);
/* One picture of C channels; tmp holds ay->in * ax->out * C floats. */
typedef void resize_fn(float *out, const float *in,
                       const struct resize_axis *ax,
                       const struct resize_axis *ay, size_t C, float *tmp);

grid_sample_fn grid_sample_baseline;
grid_sample_dgrid_fn grid_sample_dgrid_baseline;
grid_sample_dx_fn grid_sample_dx_baseline;
resize_fn resize_forward_baseline, resize_backward_baseline;
#ifdef SPID_X86
grid_sample_fn grid_sample_avx2, grid_sample_avx512;
grid_sample_dgrid_fn grid_sample_dgrid_avx2, grid_sample_dgrid_avx512;
grid_sample_dx_fn grid_sample_dx_avx2, grid_sample_dx_avx512;
resize_fn resize_forward_avx2, resize_backward_avx2;
resize_fn resize_forward_avx512, resize_backward_avx512;
#endif

#endif
