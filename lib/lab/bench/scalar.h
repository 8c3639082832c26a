/* The renderer that the kernels' speed is compared with. */
#ifndef SPID_LAB_BENCH_SCALAR_H
#define SPID_LAB_BENCH_SCALAR_H

#include "lib/splat/types.h"

/* Draw in plain float, Gaussian by Gaussian over its bounding box.  GSPLAT
 * rules.  image (H,W,3) and alpha (H,W) out.  EX_OSERR. */
int scalar_forward(float *image, float *alpha, const struct gaussians *g,
                   const struct splat_camera *cam, int width, int height,
                   struct error *err);

#endif
