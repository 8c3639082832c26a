/* Eq. C in plain float: projected, sorted, and blended Gaussian by Gaussian, as
 * one would write it first. */
#include "lib/lab/bench/scalar.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/half.h"
#include "lib/base/sort.h"

/* One Gaussian on the screen, in float. */
struct scalar_gaussian {
    float z, x, y, A, B, C, rx, ry, opacity;
};

/* cov2d = J W R S S R^T W^T J^T + 0.3, as in the paper's preliminaries. */
static int scalar_project(struct scalar_gaussian *s, const struct gaussians *g,
                          size_t i, const struct splat_camera *cam, int width,
                          int height)
{
    const float *m = g->mean + 3 * i, *sc = g->scale + 3 * i;
    const float *q = g->quat + 4 * i, *P = cam->rt;
    float n = sqrtf(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    float f = 1 / fmaxf(n, 1e-12f), c[3], a[2][3] = {{0}};
    float w = q[0] * f, x = q[1] * f, y = q[2] * f, z = q[3] * f;
    float R[3][3] = {
        {1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
        {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
        {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};

    for (int r = 0; r < 3; r++)
        c[r] = P[4 * r] * m[0] + P[4 * r + 1] * m[1] + P[4 * r + 2] * m[2] +
               P[4 * r + 3];
    if (!(c[2] > 0.01f) || g->opacity[i] < 1.0f / 255)
        return 0;
    float lx = 0.65f * (float)width / cam->fx;
    float ly = 0.65f * (float)height / cam->fy;
    float u = fminf(fmaxf(c[0] / c[2], -lx), lx);
    float v = fminf(fmaxf(c[1] / c[2], -ly), ly);

    for (int k = 0; k < 3; k++)
        for (int l = 0; l < 3; l++) {
            a[0][k] += cam->fx / c[2] * (P[l] - u * P[8 + l]) * R[l][k] * sc[k];
            a[1][k] += cam->fy / c[2] * (P[4 + l] - v * P[8 + l]) * R[l][k] *
                       sc[k];
        }
    float xx = 0.3f, xy = 0, yy = 0.3f;

    for (int k = 0; k < 3; k++) {
        xx += a[0][k] * a[0][k];
        xy += a[0][k] * a[1][k];
        yy += a[1][k] * a[1][k];
    }
    float det = xx * yy - xy * xy, L = 2 * logf(255 * g->opacity[i]);

    *s = (struct scalar_gaussian){
        .z = c[2], .x = cam->fx * c[0] / c[2] + cam->cx,
        .y = cam->fy * c[1] / c[2] + cam->cy, .A = yy / det, .B = -xy / det,
        .C = xx / det, .rx = sqrtf(L * xx), .ry = sqrtf(L * yy),
        .opacity = g->opacity[i]};
    return s->x + s->rx > 0 && s->x - s->rx < (float)width &&
           s->y + s->ry > 0 && s->y - s->ry < (float)height;
}

/* Blend one Gaussian over the pixels of its box. */
static void scalar_blend(float *image, float *T,
                         const struct scalar_gaussian *s, const float *color,
                         int width, int height)
{
    int x0 = (int)fmaxf(s->x - s->rx, 0), y0 = (int)fmaxf(s->y - s->ry, 0);
    int x1 = (int)fminf(s->x + s->rx + 1, (float)width);
    int y1 = (int)fminf(s->y + s->ry + 1, (float)height);

    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x++) {
            size_t at = (size_t)y * (size_t)width + (size_t)x;
            float dx = (float)x + 0.5f - s->x, dy = (float)y + 0.5f - s->y;
            float sigma = 0.5f * (s->A * dx * dx + s->C * dy * dy) +
                          s->B * dx * dy;

            if (T[at] < 0)
                continue;                  /* this pixel is finished */
            float alpha = fminf(s->opacity * expf(-sigma), 0.99f);

            if (alpha < 1.0f / 255)
                continue;
            float next = T[at] * (1 - alpha), w = alpha * T[at];

            if (next <= 1e-4f) {
                T[at] = -T[at];
                continue;
            }
            for (size_t c = 0; c < 3; c++)
                image[3 * at + c] += w * color[c];
            T[at] = next;
        }
}

int scalar_forward(float *image, float *alpha, const struct gaussians *g,
                   const struct splat_camera *cam, int width, int height,
                   struct error *err)
{
    struct scalar_gaussian *spot = malloc((g->n + 1) * sizeof *spot);
    uint64_t *order = malloc((g->n + 1) * sizeof *order);
    size_t pixels = (size_t)width * (size_t)height, n = 0;
    float color[3];

    if (!spot || !order) {
        free(spot);
        free(order);
        return error_set(err, EX_OSERR, "out of memory");
    }
    for (size_t i = 0; i < g->n; i++)
        if (scalar_project(&spot[i], g, i, cam, width, height))
            order[n++] = sort_key(spot[i].z, (uint32_t)i);
    sort_keys(order, n);
    memset(image, 0, 3 * pixels * sizeof *image);
    for (size_t p = 0; p < pixels; p++)
        alpha[p] = 1;
    for (size_t k = 0; k < n; k++) {
        size_t i = (uint32_t)order[k], at = i * (size_t)g->channels;

        for (int c = 0; c < 3; c++)
            color[c] = g->color ? g->color[at + (size_t)c]
                                : half_to_float(g->color_half[at + (size_t)c]);
        scalar_blend(image, alpha, &spot[i], color, width, height);
    }
    for (size_t p = 0; p < pixels; p++)
        alpha[p] = 1 - fabsf(alpha[p]);
    free(spot);
    free(order);
    return 0;
}
