/* The plane's equations (Section 3.2, U and mu): its cells' centres, and points
 * of it lifted along their rays. */
#include "lib/avatar/static_branch.h"

#include "lib/base/camera.h"
#include "lib/base/parallel.h"

void static_branch_grid(float *U0, size_t n)
{
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++) {
            U0[2 * (i * n + j)] = (float)(2 * j + 1) / (float)n - 1;
            U0[2 * (i * n + j) + 1] = (float)(2 * i + 1) / (float)n - 1;
        }
}

PARALLEL(static_branch_lift_part, k, const float *, surface, const float *, cam,
         const float *, U, const float *, p, const float *, normal, float *, mu,
         float *, o)
{
    float rise = surface ? surface[k] : 0;
    /* x/z and y/z of the ray: NDC over the focal length; its camera depth
     * at the plane is t_z, so d_s r_k = depth (x/z, y/z, 1) turned into
     * the head's frame */
    float depth = cam[11] - rise;
    float x = U[2 * k] / CAMERA_FOCAL, y = U[2 * k + 1] / CAMERA_FOCAL;

    for (int i = 0; i < 3; i++) {
        float ray = cam[i] * x + cam[4 + i] * y + cam[8 + i];

        mu[3 * k + i] = o[i] + depth * ray + (2 * p[k] - 1 - rise) * normal[i];
    }
}

void static_branch_lift(float *mu, const float *U, const float *p,
                        const float *surface, const float cam[12],
                        const float normal[3], size_t N)
{
    float o[3];

    camera_origin(o, cam);

    parallel_each(static_branch_lift_part, N, 1, surface, cam, U, p, normal, mu,
                  o);
}

PARALLEL(static_branch_lift_backward_part, k, const float *, dmu,
         const float *, cam, const float *, surface, const float *, normal,
         float *, dU, float *, dp)
{
    const float *d = dmu + 3 * k;
    float depth = cam[11] - (surface ? surface[k] : 0);

    /* mu = o + depth R^T (U/f, 1) + (2p - 1 - rise) n */
    for (int c = 0; c < 2; c++)
        dU[2 * k + c] +=
            depth / CAMERA_FOCAL *
            (cam[4 * c] * d[0] + cam[4 * c + 1] * d[1] + cam[4 * c + 2] * d[2]);
    dp[k] += 2 * (normal[0] * d[0] + normal[1] * d[1] + normal[2] * d[2]);
}

void static_branch_lift_backward(float *dU, float *dp, const float *dmu,
                                 const float *surface, const float cam[12],
                                 const float normal[3], size_t N)
{
    parallel_each(static_branch_lift_backward_part, N, 1, dmu, cam, surface,
                  normal, dU, dp);
}
