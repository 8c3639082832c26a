/* The camera: x right, y down, z forward.  cam (3,4) = [R|t], x_cam = R x + t.
 * A square picture of S pixels has f = focal * S / 2 pixels (focal = 12) and
 * its principal point at S / 2, so the same [R|t] serves every size; the
 * centre of pixel i is i + 0.5.  Gradients are added to their outputs. */
#ifndef SPID_BASE_CAMERA_H
#define SPID_BASE_CAMERA_H

#include <stddef.h>

#define CAMERA_FOCAL 12.0f
#define CAMERA_NEAR 0.01f  /* nothing nearer is drawn, head units */

/* Focal length in pixels of a picture of size pixels. */
static inline float camera_focal(float size)
{
    return CAMERA_FOCAL * size * 0.5f;
}

/* Eq. T_d.  cam (3,4) = [R | t]. */
void camera_make(float cam[12], const float R[9], const float t[3]);
/* The frontal camera at distance z: R = diag(1,-1,-1), t = (0,0,z). */
void camera_frontal(float cam[12], float z);

/* Camera coordinates of x. */
void camera_apply(float out[3], const float cam[12], const float x[3]);
/* Camera centre in the head's frame: -R^T t. */
void camera_origin(float o[3], const float cam[12]);

/* Pixel positions uv (N,2) and camera depths z (N, or NULL) of x (N,3) in a
 * picture of `size` pixels.  A point at or behind CAMERA_NEAR is divided by
 * CAMERA_NEAR instead of its z; its z tells. */
void camera_project(float *uv, float *z, const float cam[12], float size,
                    const float *x, size_t N);
/* dx (N,3, or NULL) and dcam (3,4, or NULL) += gradient of duv (N,2) and dz
 * (N, or NULL).  Points not in front get and give none. */
void camera_project_backward(float *dx, float dcam[12], const float *duv,
                             const float *dz, const float cam[12], float size,
                             const float *x, size_t N);

#endif
