/* Pull and push over square cells (pyramid.h). */
#include "lib/photo/pyramid.h"

/* Sums of 2 x 2 cells: the next level, side / 2. */
static void pyramid_pull(float *to, const float *from, size_t side, size_t n)
{
    const size_t half = side / 2;

    for (size_t y = 0; y < half; y++)
        for (size_t x = 0; x < half; x++) {
            const float *a = from + 2 * (y * side + x) * n, *b = a + side * n;

            for (size_t m = 0; m < n; m++)
                to[(y * half + x) * n + m] = a[m] + a[m + n] + b[m] + b[m + n];
        }
}

/* Each cell of `fine` gains `weight` of what `coarse` has there on average. */
static void pyramid_push(float *fine, const float *coarse, size_t side,
                         size_t n, float weight)
{
    const size_t half = side / 2, right = half > 1 ? n : 0;
    const size_t down = right * half;

    for (size_t y = 0; y < side; y++)
        for (size_t x = 0; x < side; x++) {
            float tx, ty, *to = fine + (y * side + x) * n;
            const size_t u = pyramid_between(&tx, x, side, half);
            const size_t v = pyramid_between(&ty, y, side, half);
            const float *a = coarse + (v * half + u) * n;
            const float share[4] = {(1 - tx) * (1 - ty), tx * (1 - ty),
                                    (1 - tx) * ty, tx * ty};
            const float all = share[0] * a[0] + share[1] * a[right] +
                              share[2] * a[down] + share[3] * a[down + right];

            for (size_t m = 0; m < n; m++)
                to[m] += weight / all *
                         (share[0] * a[m] + share[1] * a[m + right] +
                          share[2] * a[m + down] +
                          share[3] * a[m + down + right]);
        }
}

void pyramid_pool(float *cells, size_t side, size_t n, float weight,
                  const float *any)
{
    float *level[sizeof(size_t) * 8];
    size_t last = 0;

    level[0] = cells;
    for (size_t w = side; w > 1; w /= 2, last++) {
        level[last + 1] = level[last] + w * w * n;
        pyramid_pull(level[last + 1], level[last], w, n);
    }
    for (size_t m = 0; m < n; m++)
        level[last][m] += weight * any[m];
    for (size_t w = 2; last-- > 0; w *= 2)
        pyramid_push(level[last], level[last + 1], w, n, weight);
}
