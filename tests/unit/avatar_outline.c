/* Beside the mesh: on a disc for a person, of whom the mesh shows most on the
 * right and less on the left, the right rim alone is thin; distances count
 * cells along rows. */
#include <math.h>

#include "lib/avatar/outline.h"
#include "tests/check.h"

#define N 256
#define PERSON 0.6      /* radius, of half sides, */
#define RIGHT 0.585     /* the mesh's on the right, */
#define LEFT 0.45       /* and on the left */

static float rgba[4 * N * N], coverage[N * N], value[N * N], apart[N * N];

/* Cell k's distance from the middle, and its way to the right. */
static double outline_radius(size_t k, double *x)
{
    double y = (2.0 * (double)(k / N) + 1) / N - 1;

    *x = (2.0 * (double)(k % N) + 1) / N - 1;
    return hypot(*x, y);
}

static void outline_paint(void)
{
    double x;

    for (size_t k = 0; k < N * N; k++) {
        double r = outline_radius(k, &x);

        rgba[4 * k + 3] = r < PERSON ? 1 : 0;
        coverage[k] = r < (x > 0 ? RIGHT : LEFT) ? 1 : 0;
        value[k] = 0.25f;
    }
}

static void outline_rims(void)
{
    bool thin = true, thick = true, others = true;
    double x;

    outline_rim(value, rgba, coverage, N);
    for (size_t k = 0; k < N * N; k++) {
        double r = outline_radius(k, &x);

        if (coverage[k] > 0 || r >= PERSON)
            others = others && value[k] == 0.25f;
        else if (x > 0.05)
            thin = thin && value[k] == 1;
        else if (x < -0.05)
            thick = thick && value[k] == 0.25f;
    }
    check_that("the thin rim is found, all of it", thin);
    check_that("none of the thick one", thick);
    check_that("nothing of the mesh, nothing beside the person", others);
}

static void outline_distances(void)
{
    const size_t middle = N / 2 * N;

    outline_distance(apart, coverage, N);
    check("the mesh", (double)apart[middle + N / 2], 0);
    for (size_t k = 0; k < 10; k++)
        check("cells to the right", fabs((double)apart[middle + 203 + k] -
                                         (double)(k + 1)), 0);
    check("and to the left", fabs((double)apart[middle + 60] - 10), 0);
    check("a row without the mesh", (double)apart[3 * N + 7], 0);
}

int main(void)
{
    outline_paint();
    outline_rims();
    outline_distances();
    return check_status();
}
