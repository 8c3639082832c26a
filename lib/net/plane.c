/* The plane's points and their lifting (GAGAvatar, Section 3.2; as its public
 * code samples them). */
#include "lib/net/plane.h"

#include <math.h>

#include "lib/base/camera.h"

void gagavatar_plane(float *points, float d[3], const float cam[12], size_t n)
{
    float o[3], distance = 0;

    camera_origin(o, cam);
    for (int i = 0; i < 3; i++) {
        d[i] = cam[8 + i];                  /* R^T (0,0,1) */
        distance += o[i] * d[i];
    }
    distance = fabsf(distance);
    for (size_t k = 0; k < n * n; k++) {
        const float span = n > 1 ? 2.0f / (float)(n - 1) : 0;
        const float x = ((float)(k % n) * span - 1) / CAMERA_FOCAL;
        const float y = ((float)(k / n) * span - 1) / CAMERA_FOCAL;

        for (int i = 0; i < 3; i++)
            points[3 * k + i] = o[i] + distance * (cam[i] * x +
                                                   cam[4 + i] * y + d[i]);
    }
}

void gagavatar_lift(float *xyz, const float *points, const float *position,
                    const float d[3], float sign, size_t N)
{
    for (size_t k = 0; k < N; k++)
        for (int i = 0; i < 3; i++)
            xyz[3 * k + i] = points[3 * k + i] + sign * position[k] * d[i];
}
