/* Places of Gaussians in the source picture (place.h): the affine view and
 * the offsets from it, forward and backward. */
#include "lib/photo/place.h"

#include <math.h>
#include <string.h>

#include "lib/base/camera.h"

#define PLACE_STEEPEST 0.35f    /* of the view's determinant: 70 degrees */

/* Top left 2x2 of R R_s^T: how the source's image plane lies in the frame's
 * picture. */
static void place_plane(float P[4], const float source[12],
                        const float cam[12])
{
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++) {
            P[2 * i + j] = 0;
            for (int k = 0; k < 3; k++)
                P[2 * i + j] += cam[4 * i + k] * source[4 * j + k];
        }
}

/* Where the head's origin is seen, normalised. */
static void place_origin(float o[2], const float cam[12])
{
    float z = fmaxf(cam[11], CAMERA_NEAR);

    o[0] = CAMERA_FOCAL * cam[3] / z;
    o[1] = CAMERA_FOCAL * cam[7] / z;
}

void place_view_make(struct splat_place_view *v, const float source[12],
                     const float cam[12])
{
    float P[4], from[2], to[2];
    float scale = fmaxf(cam[11], CAMERA_NEAR) /
                  fmaxf(source[11], CAMERA_NEAR);

    place_plane(P, source, cam);
    float det = P[0] * P[3] - P[1] * P[2];
    /* steeper than that, the map of the steepest plane that is allowed */
    float inv = scale / fmaxf(det, PLACE_STEEPEST);
    v->A[0] = P[3] * inv;
    v->A[1] = -P[1] * inv;
    v->A[2] = -P[2] * inv;
    v->A[3] = P[0] * inv;
    place_origin(from, source);
    place_origin(to, cam);
    v->b[0] = from[0] - v->A[0] * to[0] - v->A[1] * to[1];
    v->b[1] = from[1] - v->A[2] * to[0] - v->A[3] * to[1];
    for (int k = 0; k < 2; k++) {
        const float *axis = source + 4 * k;

        v->toward[k] = -(axis[0] * cam[8] + axis[1] * cam[9] +
                         axis[2] * cam[10]);
    }
}

void place_channels(float *out, const float *mean, const float *uv,
                    const float *seen, const struct splat_place_view *v,
                    const float cam[12], size_t N)
{
#pragma omp parallel for schedule(static) if (N > 65536)
    for (size_t i = 0; i < N; i++) {
        const float *m = mean + 3 * i;
        float x = cam[0] * m[0] + cam[1] * m[1] + cam[2] * m[2] + cam[3];
        float y = cam[4] * m[0] + cam[5] * m[1] + cam[6] * m[2] + cam[7];
        float z = cam[8] * m[0] + cam[9] * m[1] + cam[10] * m[2] + cam[11];
        float f = CAMERA_FOCAL / fmaxf(z, CAMERA_NEAR);

        x *= f;
        y *= f;
        out[3 * i] = seen[i] * (2 * uv[2 * i] - 1 - v->A[0] * x -
                                v->A[1] * y - v->b[0]);
        out[3 * i + 1] = seen[i] * (2 * uv[2 * i + 1] - 1 - v->A[2] * x -
                                    v->A[3] * y - v->b[1]);
        out[3 * i + 2] = seen[i];
    }
}

void place_channels_backward(float *dmean, const float *dout,
                             const float *mean, const float *seen,
                             const struct splat_place_view *v,
                             const float cam[12], size_t N)
{
    for (size_t i = 0; i < N; i++) {
        /* out = seen (2 uv - 1 - A x - b) */
        float du = -seen[i] * dout[3 * i], dv = -seen[i] * dout[3 * i + 1];
        float dndc[2] = {v->A[0] * du + v->A[2] * dv,
                         v->A[1] * du + v->A[3] * dv};

        camera_project_backward(dmean + 3 * i, NULL, dndc, NULL, cam, 2,
                                mean + 3 * i, 1);
    }
}

void place_of_source(float *uv, float *seen, const float *mean,
                     const float cam[12], size_t N)
{
#pragma omp parallel for schedule(static)
    for (size_t i = 0; i < N; i++) {
        camera_project(uv + 2 * i, NULL, cam, 1, mean + 3 * i, 1);
        if (!(uv[2 * i] >= 0 && uv[2 * i] <= 1 && uv[2 * i + 1] >= 0 &&
              uv[2 * i + 1] <= 1))
            seen[i] = 0;
    }
}
