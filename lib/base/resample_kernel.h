/* The inner loops of lib/base/resample.h, one version per instruction set. */
#ifndef SPID_BASE_RESAMPLE_KERNEL_H
#define SPID_BASE_RESAMPLE_KERNEL_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/isa.h"

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

grid_sample_fn grid_sample_baseline;
grid_sample_dgrid_fn grid_sample_dgrid_baseline;
grid_sample_dx_fn grid_sample_dx_baseline;
#ifdef SPID_X86
grid_sample_fn grid_sample_avx2, grid_sample_avx512;
grid_sample_dgrid_fn grid_sample_dgrid_avx2, grid_sample_dgrid_avx512;
grid_sample_dx_fn grid_sample_dx_avx2, grid_sample_dx_avx512;
#endif

#endif
