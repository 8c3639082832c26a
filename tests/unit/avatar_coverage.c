/* Maps of what the mesh covers (coverage.h): distances to it count cells along
 * rows, and the nearest depth around a cell is the least of all those in a square. */
#include <math.h>

#include "lib/avatar/coverage.h"
#include "lib/base/random.h"
#include "tests/check.h"

#define N 256
#define RIGHT 0.585     /* the mesh's radius on the right, of half sides, */
#define LEFT 0.45       /* and on the left */

static float coverage[N * N], apart[N * N];

static void coverage_distances(void)
{
    const size_t middle = N / 2 * N;

    for (size_t k = 0; k < N * N; k++) {
        double y = (2.0 * (double)(k / N) + 1) / N - 1;
        double x = (2.0 * (double)(k % N) + 1) / N - 1;

        coverage[k] = hypot(x, y) < (x > 0 ? RIGHT : LEFT) ? 1 : 0;
    }
    coverage_distance(apart, coverage, N);
    check("the mesh", (double)apart[middle + N / 2], 0);
    for (size_t k = 0; k < 10; k++)
        check("cells to the right", fabs((double)apart[middle + 203 + k] -
                                         (double)(k + 1)), 0);
    check("and to the left", fabs((double)apart[middle + 60] - 10), 0);
    check("a row without the mesh", (double)apart[3 * N + 7], 0);
}

/* The least of z (n,n) in the square of r cells about (x,y). */
static float coverage_least(const float *z, size_t n, size_t r, size_t x,
                            size_t y)
{
    float least = INFINITY;

    for (size_t v = y > r ? y - r : 0; v <= y + r && v < n; v++)
        for (size_t u = x > r ? x - r : 0; u <= x + r && u < n; u++)
            least = fminf(least, z[v * n + u]);
    return least;
}

static void coverage_nearest(void)
{
    enum { SIDE = 19 };
    static float z[SIDE * SIDE], near[SIDE * SIDE], tmp[SIDE * SIDE];
    struct random r;

    random_init(&r, 3, "near");
    for (size_t k = 0; k < SIDE * SIDE; k++)
        z[k] = random_below(&r, 3) ? (float)random_range(&r, 1, 9) : INFINITY;
    for (size_t reach = 0; reach < 4; reach++) {
        size_t wrong = 0;

        coverage_near(near, z, SIDE, reach, tmp);
        for (size_t k = 0; k < SIDE * SIDE; k++)
            wrong += near[k] != coverage_least(z, SIDE, reach, k % SIDE,
                                               k / SIDE);
        CHECK(wrong == 0, "%zu cells around which something is nearer by %zu",
              wrong, reach);
    }
}

int main(void)
{
    coverage_distances();
    coverage_nearest();
    return check_status();
}
