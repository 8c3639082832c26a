/* Sampling of channel-last arrays, forward and backward, with the conventions
 * of the reference systems (golden 10); lib/nn/rescale.h resizes.  All arrays
 * are f32 row-major [B,H,W,C]; gradients are added to.  Results do not depend
 * on the thread count. */
#ifndef SPID_BASE_RESAMPLE_H
#define SPID_BASE_RESAMPLE_H

#include <stdbool.h>
#include <stddef.h>

enum resample_padding { RESAMPLE_ZEROS, RESAMPLE_BORDER };

/* out [B,N,C] = x [B,H,W,C] bilinearly at grid [B,N,2] (x then y in [-1,1];
 * align: -1 and 1 are the centres of the border pixels, otherwise their outer
 * edges). */
void grid_sample(float *out, const float *x, const float *grid, size_t B,
                 size_t H, size_t W, size_t C, size_t N, bool align,
                 enum resample_padding pad);
/* Adds to gx [B,H,W,C] and ggrid [B,N,2] (either may be NULL). */
void grid_sample_backward(float *gx, float *ggrid, const float *gout,
                          const float *x, const float *grid, size_t B,
                          size_t H, size_t W, size_t C, size_t N, bool align,
                          enum resample_padding pad);

/* grid [B,h,w,2] = theta [B,2,3] applied to the positions of an h x w
 * picture's pixels. */
void affine_grid(float *grid, const float *theta, size_t B, size_t h,
                 size_t w, bool align);
/* gtheta [B,2,3] += what ggrid gives it. */
void affine_grid_backward(float *gtheta, const float *ggrid, size_t B,
                          size_t h, size_t w, bool align);

#endif
