/* Sampling as PyTorch does it: grid_sample and affine_grid, with gradients. */
#include "lib/base/resample.h"

#include "lib/base/cpu.h"
#include "lib/base/resample_kernel.h"

void grid_sample(float *out, const float *x, const float *grid, size_t B,
                 size_t H, size_t W, size_t C, size_t N, bool align,
                 enum resample_padding pad)
{
    CPU_PICK(grid_kernels)->sample(out, x, grid, B, H, W, C, N, align,
                                   pad == RESAMPLE_BORDER);
}

void grid_sample_backward(float *gx, float *ggrid, const float *gout,
                          const float *x, const float *grid, size_t B,
                          size_t H, size_t W, size_t C, size_t N, bool align,
                          enum resample_padding pad)
{
    const struct grid_kernels *k = CPU_PICK(grid_kernels);

    if (ggrid)
        k->dgrid(ggrid, gout, x, grid, B, H, W, C, N, align,
                 pad == RESAMPLE_BORDER);
    if (gx)
        k->dx(gx, gout, grid, B, H, W, C, N, align, pad == RESAMPLE_BORDER);
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
