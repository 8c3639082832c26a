/* The inner loops of lib/base/resample.h, one version per instruction set. */
#ifndef SPID_BASE_RESAMPLE_KERNEL_H
#define SPID_BASE_RESAMPLE_KERNEL_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/isa.h"

struct grid_kernels {
    void (*sample)(float *out, const float *x, const float *grid, size_t B,
                   size_t H, size_t W, size_t C, size_t N, bool align,
                   bool border);
    void (*dgrid)(float *ggrid, const float *gout, const float *x,
                  const float *grid, size_t B, size_t H, size_t W, size_t C,
                  size_t N, bool align, bool border);
    void (*dx)(float *gx, const float *gout, const float *grid, size_t B,
               size_t H, size_t W, size_t C, size_t N, bool align,
               bool border);
};

ISA_VERSIONS(const struct grid_kernels, grid_kernels);

#endif
