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

struct static_branch_lift_part {
    const float *surface, *cam, *U, *p, *normal;
    float *mu, *o;
};

static void static_branch_lift_part(void *ctx, size_t k)
{
    const struct static_branch_lift_part *c = ctx;
    float rise = c->surface ? c->surface[k] : 0;
    /* x/z and y/z of the ray: NDC over the focal length; its camera depth
     * at the plane is t_z, so d_s r_k = depth (x/z, y/z, 1) turned into
     * the head's frame */
    float depth = c->cam[11] - rise;
    float x = c->U[2 * k] / CAMERA_FOCAL, y = c->U[2 * k + 1] / CAMERA_FOCAL;

    for (int i = 0; i < 3; i++) {
        float ray = c->cam[i] * x + c->cam[4 + i] * y + c->cam[8 + i];

        c->mu[3 * k + i] =
            c->o[i] + depth * ray + (2 * c->p[k] - 1 - rise) * c->normal[i];
    }
}

void static_branch_lift(float *mu, const float *U, const float *p,
                        const float *surface, const float cam[12],
                        const float normal[3], size_t N)
{
    float o[3];

    camera_origin(o, cam);

    parallel_for(
        N, 1, static_branch_lift_part,
        &(struct static_branch_lift_part){ surface, cam, U, p, normal, mu, o });
}

struct static_branch_lift_backward_part {
    const float *dmu, *cam, *surface, *normal;
    float *dU, *dp;
};

static void static_branch_lift_backward_part(void *ctx, size_t k)
{
    const struct static_branch_lift_backward_part *a = ctx;
    const float *d = a->dmu + 3 * k;
    float depth = a->cam[11] - (a->surface ? a->surface[k] : 0);

    /* mu = o + depth R^T (U/f, 1) + (2p - 1 - rise) n */
    for (int c = 0; c < 2; c++)
        a->dU[2 * k + c] += depth / CAMERA_FOCAL *
                            (a->cam[4 * c] * d[0] + a->cam[4 * c + 1] * d[1] +
                             a->cam[4 * c + 2] * d[2]);
    a->dp[k] +=
        2 * (a->normal[0] * d[0] + a->normal[1] * d[1] + a->normal[2] * d[2]);
}

void static_branch_lift_backward(float *dU, float *dp, const float *dmu,
                                 const float *surface, const float cam[12],
                                 const float normal[3], size_t N)
{
    parallel_for(N, 1, static_branch_lift_backward_part,
                 &(struct static_branch_lift_backward_part){ dmu, cam, surface,
                                                             normal, dU, dp });
}
