/* Gaussians near a person's edge: distances to the edge of a disc against the
 * exact ones, what is clamped, and its gradient. */
#include <math.h>
#include <stdlib.h>

#include "lib/avatar/edge_scale.h"
#include "tests/check.h"

#define N 64
#define RADIUS 20.0
#define MIN 0.6f

/* How far cell k is from the nearest one outside of the disc. */
static double edge_distance(size_t k, const float *rgba)
{
    double min = INFINITY;

    for (size_t i = 0; i < N * N; i++)
        if (!(rgba[4 * i + 3] > 0))
            min = fmin(min, hypot((double)(i % N) - (double)(k % N),
                                      (double)(i / N) - (double)(k / N)));
    return min;
}

int main(void)
{
    static float rgba[4 * N * N], max[N * N], scale[3 * N * N];
    static float clamped[3 * N * N], grad[3 * N * N];
    double worst = 0, apart = 0;
    size_t smaller = 0, wrong = 0;

    for (size_t k = 0; k < N * N; k++) {
        const double x = (double)(k % N) - N / 2, y = (double)(k / N) - N / 2;

        rgba[4 * k + 3] = hypot(x, y) < RADIUS;
    }
    edge_scale_find(max, rgba, MIN, N);
    for (size_t k = 0; k < N * N; k++) {
        const double exact = fmax(0.5 * edge_distance(k, rgba), MIN);

        worst = fmax(worst, fabs(max[k] / exact - 1));
    }
    check("half the way to the edge, relative", worst, 0.09);
    for (size_t i = 0; i < 3 * N * N; i++) {
        scale[i] = 0.01f * (float)(i % 7);
        grad[i] = 1;
    }
    edge_scale_clamp(scale, clamped, max, 0.02f, N * N);
    edge_scale_clamp_backward(grad, clamped, N * N);
    for (size_t i = 0; i < 3 * N * N; i++) {
        const float own = 0.01f * (float)(i % 7), limit = 0.02f * max[i / 3];

        apart = fmax(apart, fabs(scale[i] - fmin(own, limit)));
        smaller += own > limit;
        wrong += (grad[i] == 0) != (own > limit);
    }
    check("no larger than that", apart, 1e-9);
    check_that("some were, and lose their gradient alone",
               smaller > N * N && smaller < 3 * N * N && wrong == 0);
    for (size_t k = 0; k < N * N; k++)
        rgba[4 * k + 3] = 1;
    edge_scale_find(max, rgba, MIN, N);
    check_that("without an edge nothing is clamped", isinf(max[N + 1]));
    return check_status();
}
