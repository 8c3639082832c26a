/* Gaussians to pixels and back: the paper's Eq. C, forward and backward.
 *
 * Order of calls:  splat_init; splat_load (once per set of Gaussians);
 * then per frame splat_update (what moved) and splat_draw; for training
 * splat_backward after splat_draw.  Images are (H, W, C), row-major.
 * Same bytes for every thread count.  Errors: 0, or -1 and *err. */
#ifndef SPID_SPLAT_SPLAT_H
#define SPID_SPLAT_SPLAT_H

#include "lib/splat/types.h"

/* Camera of a picture of size x size: f = focal * size / 2 (the toolkit's
 * focal is CAMERA_FOCAL, 12), centre size / 2. */
struct splat_camera splat_camera_square(const float rt[12], int size,
                                        float focal);

/* Defaults for a picture of that size. */
struct splat_options splat_defaults(int width, int height, int channels);

/* Check the options and make the renderer.  EX_USAGE names the option that is
 * out of range and what would do. */
int splat_init(struct splat *s, const struct splat_options *opt,
               struct error *err);
void splat_release(struct splat *s);   /* of a zeroed *s: nothing */

/* Take over a set of Gaussians (copied and packed; g may go away after the
 * call).  N may be 0.  EX_DATAERR with array and index on a number that is
 * not finite, a negative scale, an opacity outside [0,1]. */
int splat_load(struct splat *s, const struct gaussians *g,
               struct error *err);

/* New centres for Gaussians first .. first + count - 1; mean is (count,3).
 * Nothing else is touched, and only these are projected again if the camera
 * stays.  EX_DATAERR when out of range or not finite. */
int splat_update(struct splat *s, const float *mean, size_t first,
                 size_t count, struct error *err);

/* Draw whichever pictures are wanted.
 *   image (H,W,C) out  sum_i c_i w_i + T background, sRGB values for the
 *                      first three channels; or half, in half precision
 *   alpha (H,W)   out  1 - T
 *   depth (H,W)   out  sum_i w_i z_i / sum_i w_i, camera z in head units, 0
 *                      where nothing is; only with opt.depth
 *   view          in   may be NULL without place
 *   background (C) in  or NULL: zeros
 * EX_DATAERR on a camera that is not finite, a singular R, a focal <= 0. */
int splat_draw(struct splat *s, const struct splat_pictures *out,
               const struct splat_camera *cam,
               const struct splat_place_view *view, const float *background,
               struct error *err);

/* Gradients of a loss from those of the pictures that the last splat_draw drew
 * with opt.gradients set.  Adds into g.  No gradient where the 0.99 clamp is
 * active.  Places pull at the Gaussians through their weights and through where
 * their centres are; the view is held.  Sums run in a fixed order: same bits
 * for every thread count. */
int splat_backward(struct splat *s, const struct splat_gradients *g,
                   const struct splat_picture_gradients *d, struct error *err);

#endif
