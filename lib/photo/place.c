/* Places of Gaussians in the source picture (place.h): the affine view and
 * the offsets from it, forward and backward. */
#include "lib/photo/place.h"

#include <math.h>
#include <string.h>

#include "lib/base/camera.h"
#include "lib/base/parallel.h"

#define PLACE_REACH 3.0f        /* standard deviations that are drawn of any */
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

PARALLEL(place_of_source_part, i, float *, uv, float *, seen,
         const float *, cam, const float *, mean, const float *, scale)
{
    const float *s = scale + 3 * i, *at = uv + 2 * i;
    float z;

    camera_project(uv + 2 * i, &z, cam, 1, mean + 3 * i, 1);
    const float r = PLACE_REACH * fmaxf(s[0], fmaxf(s[1], s[2])) *
                    CAMERA_FOCAL / (2 * z);

    if (!(z > CAMERA_NEAR && at[0] >= -r && at[0] <= 1 + r && at[1] >= -r &&
          at[1] <= 1 + r))
        seen[i] = 0;
}

void place_of_source(float *uv, float *seen, const float *mean,
                     const float *scale, const float cam[12], size_t N)
{
    parallel_each(place_of_source_part, N, 1, uv, seen, cam, mean, scale);
}
