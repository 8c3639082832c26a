/* Distances to the person's edge by two passes over the cells (Borgefors 1986,
 * chamfer distances), and the Gaussians that they make smaller
 * (edge_scale.h). */
#include "lib/avatar/edge_scale.h"

#include <math.h>

#include "lib/base/parallel.h"

#define NOBODY 0.05f    /* the largest matte that is background */
#define REACH 0.5f      /* standard deviation over the way to the edge */
#define DIAGONAL 1.4142f

/* Cell (x,y) is no farther from nobody than a neighbour and the way there:
 * those of the row before it and the one beside it, or, backwards, of the row
 * after it and on its other side. */
static float edge_scale_nearer(const float *far, long n, long x, long y,
                               long step)
{
    const long to[4][2] = {{step, 0}, {0, step}, {step, step}, {-step, step}};
    float min = far[y * n + x];

    for (int i = 0; i < 4; i++) {
        const long u = x + to[i][0], v = y + to[i][1];

        if (u >= 0 && v >= 0 && u < n && v < n)
            min = fminf(min, far[v * n + u] + (i < 2 ? 1 : DIAGONAL));
    }
    return min;
}

void edge_scale_find(float *max, const float *rgba, float min, size_t n)
{
    const long side = (long)n, cells = side * side;

    for (long k = 0; k < cells; k++)
        max[k] = rgba[4 * k + 3] > NOBODY ? INFINITY : 0;
    for (long k = 0; k < cells; k++)
        max[k] = edge_scale_nearer(max, side, k % side, k / side, -1);
    for (long k = cells; k-- > 0; )
        max[k] = edge_scale_nearer(max, side, k % side, k / side, 1);
    for (long k = 0; k < cells; k++)
        max[k] = fmaxf(REACH * max[k], min);
}

PARALLEL(edge_scale_clamp_part, i, const float *, max, float *, clamped,
         float *, scale, float, cell)
{
    const float limit = max[i / 3] * cell;

    if (clamped)
        clamped[i] = scale[i] > limit;
    scale[i] = fminf(scale[i], limit);
}

void edge_scale_clamp(float *scale, float *clamped, const float *max,
                      float cell, size_t count)
{
    parallel_each(edge_scale_clamp_part, 3 * count, 1, max, clamped, scale,
                  cell);
}

void edge_scale_clamp_backward(float *dscale, const float *clamped,
                               size_t count)
{
    for (size_t i = 0; i < 3 * count; i++)
        if (clamped[i] > 0)
            dscale[i] = 0;
}
