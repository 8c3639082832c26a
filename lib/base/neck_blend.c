/* Blending at the neck: two-bone linear blend skinning of points by height,
 * and its gradient by points and camera.  Ours; the paper turns shoulders
 * with the head. */
#include "lib/base/neck_blend.h"

#include <math.h>

const float neck_blend_upright[9] = {1, 0, 0, 0, -1, 0, 0, 0, -1};

void neck_blend_range(size_t *first, size_t *count, const float *weight,
                      size_t begin, size_t end)
{
    while (begin < end && weight[begin] == 0)
        begin++;
    while (end > begin && weight[end - 1] == 0)
        end--;
    *first = begin;
    *count = end - begin;
}

/* M x + p - M p with M = R^T from: about the pivot. */
void neck_blend_body(float body[12], const float pivot[3],
                     const float from[9], const float cam[12])
{
    for (int i = 0; i < 3; i++) {
        body[4 * i + 3] = pivot[i];
        for (int j = 0; j < 3; j++) {
            body[4 * i + j] = cam[i] * from[j] + cam[4 + i] * from[3 + j] +
                              cam[8 + i] * from[6 + j];
            body[4 * i + 3] -= body[4 * i + j] * pivot[j];
        }
    }
}

/* R^T d tanh(|d| / most) most / |d|, d between the pivot's two places before
 * the camera. */
void neck_blend_stay(float stay[3], const float pivot[3],
                     const float source[12], const float cam[12])
{
    float d[3], square = 0;

    for (int i = 0; i < 3; i++) {
        const float *s = source + 4 * i, *c = cam + 4 * i;

        d[i] = (s[0] - c[0]) * pivot[0] + (s[1] - c[1]) * pivot[1] +
               (s[2] - c[2]) * pivot[2] + s[3] - c[3];
        square += d[i] * d[i];
    }
    const float far = fmaxf(sqrtf(square) / NECK_BLEND_STAY, 1e-6f);
    const float share = tanhf(far) / far;
    for (int i = 0; i < 3; i++)
        stay[i] = share * (cam[i] * d[0] + cam[4 + i] * d[1] +
                           cam[8 + i] * d[2]);
}

/* x + w (B x - x). */
void neck_blend_points(float *out, const float *x, const float *weight,
                       size_t N, const float body[12])
{
    for (size_t k = 0; k < N; k++) {
        float w = weight[k], p[3] = {x[3 * k], x[3 * k + 1], x[3 * k + 2]};

        for (int i = 0; i < 3; i++) {
            const float *m = body + 4 * i;

            out[3 * k + i] = p[i] + w * (m[0] * p[0] + m[1] * p[1] +
                                         m[2] * p[2] + m[3] - p[i]);
        }
    }
}

/* dx = g + w (M^T g - g); dR = sum of w from (x - p) g^T, in double. */
void neck_blend_points_backward(float *dx, float dcam[12], const float *dout,
                                const float *x, const float *weight,
                                size_t N, const float pivot[3],
                                const float from[9], const float cam[12])
{
    float body[12];
    double dR[9] = {0};

    neck_blend_body(body, pivot, from, cam);
    for (size_t k = 0; k < N; k++) {
        const float *g = dout + 3 * k, *p = x + 3 * k;
        float w = weight[k];

        for (int j = 0; dx && j < 3; j++)
            dx[3 * k + j] += g[j] + w * (body[j] * g[0] + body[4 + j] * g[1] +
                                         body[8 + j] * g[2] - g[j]);
        if (!dcam || w == 0)
            continue;
        /* w R^T a with a = from (x - pivot) */
        for (int i = 0; i < 3; i++) {
            const float *f = from + 3 * i;
            double a = (double)w * (f[0] * (p[0] - pivot[0]) +
                                    f[1] * (p[1] - pivot[1]) +
                                    f[2] * (p[2] - pivot[2]));

            for (int j = 0; j < 3; j++)
                dR[3 * i + j] += a * g[j];
        }
    }
    for (int i = 0; dcam && i < 9; i++)
        dcam[4 * (i / 3) + i % 3] += (float)dR[i];
}
