/* The light on a head from one picture: a linear fit of luminance by normals,
 * reweighted a few times so that hair, shadow and paint count little (iterated
 * reweighted least squares with Cauchy weights).  Ours, not the paper's. */
#include "lib/avatar/light.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "lib/base/parallel.h"

#define ROUNDS 8        /* of reweighting */
#define RIDGE 1e-3      /* regularisation of l, share of the weights' sum */
#define OTHER 0.05      /* distance of chroma that halves a vertex's weight */
#define DARK 0.05f      /* a smaller sum of r, g and b tells nothing */

/* Luminance as a linear function of the normal, and how well it fits. */
struct light_model {
    double a[4];        /* luminance a[0] + a[1..3].n */
    double chroma[3];   /* mean */
    double spread;      /* mean absolute residual */
    bool begun;
};

/* Luminance of linear light, negative if too dark to tell, and chroma of vertex
 * v's sRGB colour. */
PARALLEL(light_split, v, float *, tmp, const float *, rgba)
{
    const float *rgb = rgba + 4 * v;
    float sum = rgb[0] + rgb[1] + rgb[2], *out = tmp + 4 * v;

    out[0] = 0;
    for (int c = 0; c < 3; c++) {
        out[0] += powf(rgb[c], 2.2f) / 3;
        out[1 + c] = rgb[c] / (sum + 1e-3f);
    }
    if (!(sum > DARK))
        out[0] = -1;
}

/* Luminance less the fit's at normal n. */
static double light_residual(const struct light_model *f, double light,
                             const float n[3])
{
    return light - f->a[0] - f->a[1] * (double)n[0] -
           f->a[2] * (double)n[1] - f->a[3] * (double)n[2];
}

/* The factor of a vertex's weight after the last round: Cauchy's weights of its
 * residual and of its chroma. */
static double light_robust_weight(const struct light_model *f,
                                  const float color[4], const float n[3])
{
    double r = light_residual(f, (double)color[0], n) / (2 * f->spread);
    double off = 0;

    if (!f->begun)
        return 1;
    for (int c = 0; c < 3; c++)
        off += fabs((double)color[1 + c] - f->chroma[c]);
    off /= OTHER;
    return 1 / ((1 + r * r) * (1 + off * off));
}

/* Solve the symmetric, positive M x = y; M and y are used up. */
static void light_solve(double x[4], double M[4][4], double y[4])
{
    for (int i = 0; i < 4; i++)
        for (int k = i + 1; k < 4; k++) {
            double f = M[k][i] / M[i][i];

            for (int j = i; j < 4; j++)
                M[k][j] -= f * M[i][j];
            y[k] -= f * y[i];
        }
    for (int i = 3; i >= 0; i--) {
        x[i] = y[i];
        for (int j = i + 1; j < 4; j++)
            x[i] -= M[i][j] * x[j];
        x[i] /= M[i][i];
    }
}

/* One round: weights by the last fit, a new fit by the weights.  false: there
 * is nothing to see. */
static bool light_fit_again(struct light_model *f, const float *colors,
                            const float *normal, const float *weight, size_t V)
{
    double M[4][4] = {{0}}, y[4] = {0}, sum = 0, spread = 0;
    struct light_model next = {.begun = true};

    for (size_t v = 0; v < V; v++) {
        const float *n = normal + 3 * v, *color = colors + 4 * v;
        double row[4] = {1, (double)n[0], (double)n[1], (double)n[2]};
        double light = (double)color[0], w;

        if (light < 0 || !(weight[v] > 0))
            continue;
        w = (double)weight[v] * light_robust_weight(f, color, n);
        sum += w;
        spread += w * fabs(light_residual(f, light, n));
        for (int i = 0; i < 4; i++) {
            y[i] += w * row[i] * light;
            for (int j = 0; j < 4; j++)
                M[i][j] += w * row[i] * row[j];
        }
        for (int c = 0; c < 3; c++)
            next.chroma[c] += w * (double)color[1 + c];
    }
    if (!(sum > 1))
        return false;
    for (int i = 1; i < 4; i++)
        M[i][i] += RIDGE * sum;
    light_solve(next.a, M, y);
    for (int c = 0; c < 3; c++)
        next.chroma[c] /= sum;
    next.spread = spread / sum + 1e-4;
    *f = next;
    return true;
}

/* l is the fit's slope over its mean. */
void light_fit(float l[3], const float *rgba, const float *normal,
               const float *weight, size_t V, float *tmp)
{
    struct light_model f = {.begun = false};
    double length = 0;

    memset(l, 0, 3 * sizeof *l);
    parallel_each(light_split, V, 1, tmp, rgba);
    for (int round = 0; round < ROUNDS; round++)
        if (!light_fit_again(&f, tmp, normal, weight, V))
            return;
    for (int c = 0; c < 3; c++) {
        l[c] = (float)(f.a[1 + c] / fmax(f.a[0], 1e-3));
        length += (double)l[c] * (double)l[c];
    }
    for (int c = 0; c < 3 && length > 1; c++)
        l[c] /= sqrtf((float)length);
}
