/* Pinhole projection and its gradients; see camera.h for the axes. */
#include "lib/base/camera.h"

void camera_make(float cam[12], const float R[9], const float t[3])
{
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            cam[4 * i + j] = R[3 * i + j];
        cam[4 * i + 3] = t[i];
    }
}

void camera_frontal(float cam[12], float z)
{
    const float R[9] = {1, 0, 0, 0, -1, 0, 0, 0, -1}, t[3] = {0, 0, z};

    camera_make(cam, R, t);
}

void camera_apply(float out[3], const float cam[12], const float x[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = cam[4 * i] * x[0] + cam[4 * i + 1] * x[1] +
                 cam[4 * i + 2] * x[2] + cam[4 * i + 3];
}

void camera_origin(float o[3], const float cam[12])
{
    for (int i = 0; i < 3; i++)
        o[i] = -(cam[i] * cam[3] + cam[4 + i] * cam[7] +
                 cam[8 + i] * cam[11]);
}

void camera_project(float *uv, float *z, const float cam[12], float size,
                    const float *x, size_t N)
{
    float f = camera_focal(size), c = 0.5f * size;

    for (size_t n = 0; n < N; n++) {
        float p[3];

        camera_apply(p, cam, x + 3 * n);
        float w = f / (p[2] > CAMERA_NEAR ? p[2] : CAMERA_NEAR);
        uv[2 * n] = c + w * p[0];
        uv[2 * n + 1] = c + w * p[1];
        if (z)
            z[n] = p[2];
    }
}

void camera_project_backward(float *dx, float dcam[12], const float *duv,
                             const float *dz, const float cam[12], float size,
                             const float *x, size_t N)
{
    double f = camera_focal(size), sum[12] = {0};

    for (size_t n = 0; n < N; n++) {
        const float *xn = x + 3 * n;
        float p[3];

        camera_apply(p, cam, xn);
        if (p[2] <= CAMERA_NEAR)
            continue;
        double w = f / p[2], dp[3] = {w * duv[2 * n], w * duv[2 * n + 1]};
        dp[2] = (dz ? dz[n] : 0) - (dp[0] * p[0] + dp[1] * p[1]) / p[2];
        for (int i = 0; i < 3; i++) {
            if (dx)
                dx[3 * n + i] += (float)(cam[i] * dp[0] +
                                         cam[4 + i] * dp[1] +
                                         cam[8 + i] * dp[2]);
            sum[4 * i + 3] += dp[i];
            for (int j = 0; j < 3; j++)
                sum[4 * i + j] += dp[i] * xn[j];
        }
    }
    for (int i = 0; dcam && i < 12; i++)
        dcam[i] += (float)sum[i];
}
