/* What tests ask of cameras and programs do not: the projection and its
 * gradients in double, and rays. */
#ifndef SPID_TESTS_CAMERA_DOUBLE_H
#define SPID_TESTS_CAMERA_DOUBLE_H

#include "lib/base/camera.h"

/* Direction in the head's frame of the ray through pixel position (u, v) of a
 * picture of `size` pixels; not normalised: its camera z is 1. */
static inline void camera_ray(float d[3], const float cam[12], float size, float u, float v)
{
    float f = camera_focal(size), c = 0.5f * size;
    float x = (u - c) / f, y = (v - c) / f;

    for (int i = 0; i < 3; i++)
        d[i] = cam[i] * x + cam[4 + i] * y + cam[8 + i];
}

/* camera_project in double. */
static inline void camera_project_d(double *uv, double *z,
                                    const double cam[12], double size,
                                    const double *x, size_t N)
{
    double f = (double)CAMERA_FOCAL * size * 0.5, c = 0.5 * size;

    for (size_t n = 0; n < N; n++) {
        double p[3], near = (double)CAMERA_NEAR;

        for (int i = 0; i < 3; i++)
            p[i] = cam[4 * i] * x[3 * n] + cam[4 * i + 1] * x[3 * n + 1] +
                   cam[4 * i + 2] * x[3 * n + 2] + cam[4 * i + 3];
        double w = f / (p[2] > near ? p[2] : near);
        uv[2 * n] = c + w * p[0];
        uv[2 * n + 1] = c + w * p[1];
        if (z)
            z[n] = p[2];
    }
}

/* camera_project_backward in double. */
static inline void camera_project_backward_d(double *dx, double dcam[12],
                                             const double *duv,
                                             const double *dz,
                                             const double cam[12], double size,
                                             const double *x, size_t N)
{
    double f = (double)CAMERA_FOCAL * size * 0.5;

    for (size_t n = 0; n < N; n++) {
        const double *xn = x + 3 * n;
        double p[3], dp[3];

        for (int i = 0; i < 3; i++)
            p[i] = cam[4 * i] * xn[0] + cam[4 * i + 1] * xn[1] +
                   cam[4 * i + 2] * xn[2] + cam[4 * i + 3];
        if (p[2] <= (double)CAMERA_NEAR)
            continue;
        dp[0] = f / p[2] * duv[2 * n];
        dp[1] = f / p[2] * duv[2 * n + 1];
        dp[2] = (dz ? dz[n] : 0) - (dp[0] * p[0] + dp[1] * p[1]) / p[2];
        for (int i = 0; i < 3; i++) {
            if (dx)
                dx[3 * n + i] += cam[i] * dp[0] + cam[4 + i] * dp[1] +
                                 cam[8 + i] * dp[2];
            if (dcam)
                dcam[4 * i + 3] += dp[i];
            for (int j = 0; dcam && j < 3; j++)
                dcam[4 * i + j] += dp[i] * xn[j];
        }
    }
}

#endif
