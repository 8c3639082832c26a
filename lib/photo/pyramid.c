/* Pull and push over square cells (pyramid.h). */
#include "lib/photo/pyramid.h"

#include "lib/base/parallel.h"
#include "lib/base/quad.h"

#define GRAIN 4096              /* cells that one thread takes at once */

/* to (n) = a + b + c + d. */
static inline void pyramid_add(float *to, const float *a, const float *b,
                               const float *c, const float *d, size_t n)
{
    size_t m = 0;

    for (; m + 4 <= n; m += 4)
        *(quad *)(to + m) = *(const quad *)(a + m) + *(const quad *)(b + m) +
                            *(const quad *)(c + m) + *(const quad *)(d + m);
    for (; m < n; m++)
        to[m] = a[m] + b[m] + c[m] + d[m];
}

/* Row y of the sums of 2 x 2 cells: the next level, side / 2. */
PARALLEL(pyramid_pull, y, float *, to, const float *, from, size_t, side,
         size_t, n)
{
    const float *a = from + 2 * y * side * n, *b = a + side * n;

    to += y * side / 2 * n;
    for (size_t x = 0; x < side / 2; x++, to += n, a += 2 * n, b += 2 * n)
        pyramid_add(to, a, a + n, b, b + n, n);
}

/* to (n) += by times the mean of four cells. */
static inline void pyramid_gain(float *to, const float *const a[4],
                                const float share[4], float by, size_t n)
{
    size_t m = 0;

    for (; m + 4 <= n; m += 4)
        *(quad *)(to + m) += by * (share[0] * *(const quad *)(a[0] + m) +
                                   share[1] * *(const quad *)(a[1] + m) +
                                   share[2] * *(const quad *)(a[2] + m) +
                                   share[3] * *(const quad *)(a[3] + m));
    for (; m < n; m++)
        to[m] += by * (share[0] * a[0][m] + share[1] * a[1][m] +
                       share[2] * a[2][m] + share[3] * a[3][m]);
}

/* Each cell of row y of `fine` gains `weight` of what `coarse` has there on
 * average. */
PARALLEL(pyramid_push, y, float *, fine, const float *, coarse, size_t, side,
         size_t, n, float, weight)
{
    const size_t half = side / 2, right = half > 1 ? n : 0;
    const size_t down = right * half;
    float tx, ty;
    const size_t v = pyramid_between(&ty, y, side, half);

    for (size_t x = 0; x < side; x++) {
        const size_t u = pyramid_between(&tx, x, side, half);
        const float *a = coarse + (v * half + u) * n;
        const float *const four[4] = {a, a + right, a + down, a + down + right};
        const float share[4] = {(1 - tx) * (1 - ty), tx * (1 - ty),
                                (1 - tx) * ty, tx * ty};
        const float all = share[0] * four[0][0] + share[1] * four[1][0] +
                          share[2] * four[2][0] + share[3] * four[3][0];

        pyramid_gain(fine + (y * side + x) * n, four, share, weight / all, n);
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
        parallel_each(pyramid_pull, w / 2, GRAIN / w + 1, level[last + 1],
                      level[last], w, n);
    }
    for (size_t m = 0; m < n; m++)
        level[last][m] += weight * any[m];
    for (size_t w = 2; last-- > 0; w *= 2)
        parallel_each(pyramid_push, w, GRAIN / w + 1, level[last],
                      level[last + 1], w, n, weight);
}
