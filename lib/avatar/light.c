#include "lib/avatar/light.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#define ROUNDS 8
#define RIDGE 1e-3      /* of the weights' sum, on l */
#define OTHER 0.05      /* distance of chroma that halves a vertex's say */
#define DARK 0.05       /* sums of colours that say nothing */

struct fit {
    double a[4];        /* luminance a[0] + a[1..3].n */
    double chroma[3];   /* mean */
    double spread;      /* mean absolute residual */
    bool begun;
};

/* Luminance of linear light, and chroma, of an sRGB colour. */
static double split(double chroma[3], const float rgb[3])
{
    double sum = (double)rgb[0] + (double)rgb[1] + (double)rgb[2], light = 0;

    for (int c = 0; c < 3; c++) {
        chroma[c] = (double)rgb[c] / (sum + 1e-3);
        light += pow((double)rgb[c], 2.2) / 3;
    }
    return sum > DARK ? light : -1;
}

static double residual(const struct fit *f, double light, const float n[3])
{
    return light - f->a[0] - f->a[1] * (double)n[0] -
           f->a[2] * (double)n[1] - f->a[3] * (double)n[2];
}

/* What is left of a vertex's weight, by what the last round found. */
static double trust(const struct fit *f, double light, const double chroma[3],
                    const float n[3])
{
    double r = residual(f, light, n) / (2 * f->spread), off = 0;

    if (!f->begun)
        return 1;
    for (int c = 0; c < 3; c++)
        off += fabs(chroma[c] - f->chroma[c]);
    off /= OTHER;
    return 1 / ((1 + r * r) * (1 + off * off));
}

/* Solve the symmetric, positive M x = y; M and y are used up. */
static void solve(double x[4], double M[4][4], double y[4])
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
static bool fit_again(struct fit *f, const float *rgba, const float *normal,
                      const float *weight, size_t V)
{
    double M[4][4] = {{0}}, y[4] = {0}, sum = 0, spread = 0;
    struct fit next = {.begun = true};

    for (size_t v = 0; v < V; v++) {
        const float *n = normal + 3 * v;
        double row[4] = {1, (double)n[0], (double)n[1], (double)n[2]};
        double chroma[3], light = split(chroma, rgba + 4 * v), w;

        if (light < 0 || !(weight[v] > 0))
            continue;
        w = (double)weight[v] * trust(f, light, chroma, n);
        sum += w;
        spread += w * fabs(residual(f, light, n));
        for (int i = 0; i < 4; i++) {
            y[i] += w * row[i] * light;
            for (int j = 0; j < 4; j++)
                M[i][j] += w * row[i] * row[j];
        }
        for (int c = 0; c < 3; c++)
            next.chroma[c] += w * chroma[c];
    }
    if (!(sum > 1))
        return false;
    for (int i = 1; i < 4; i++)
        M[i][i] += RIDGE * sum;
    solve(next.a, M, y);
    for (int c = 0; c < 3; c++)
        next.chroma[c] /= sum;
    next.spread = spread / sum + 1e-4;
    *f = next;
    return true;
}

void light_fit(float l[3], const float *rgba, const float *normal,
               const float *weight, size_t V)
{
    struct fit f = {.begun = false};
    double length = 0;

    memset(l, 0, 3 * sizeof *l);
    for (int round = 0; round < ROUNDS; round++)
        if (!fit_again(&f, rgba, normal, weight, V))
            return;
    for (int c = 0; c < 3; c++) {
        l[c] = (float)(f.a[1 + c] / fmax(f.a[0], 1e-3));
        length += (double)l[c] * (double)l[c];
    }
    for (int c = 0; c < 3 && length > 1; c++)
        l[c] /= sqrtf((float)length);
}
