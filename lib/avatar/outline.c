/* The mesh's outline on the plane: distances along rows, and thin rims by what
 * lies around a cell (outline.h). */
#include "lib/avatar/outline.h"

#include <math.h>
#include <stdbool.h>

#include "lib/base/parallel.h"

#define RIM 0.027f      /* a rim's largest width, half sides of the picture */
#define NOBODY 0.3f     /* the largest matte that is background */

void outline_distance(float *out, const float *coverage, size_t n)
{
    for (size_t row = 0; row < n * n; row += n) {
        float left = INFINITY, right = INFINITY;

        for (size_t k = row; k < row + n; k++)
            out[k] = left = coverage[k] >= OUTLINE_COVERED ? 0 : left + 1;
        for (size_t k = row + n; k-- > row; ) {
            right = coverage[k] >= OUTLINE_COVERED ? 0 : right + 1;
            out[k] = fminf(out[k], right);
            out[k] = isfinite(out[k]) ? out[k] : 0;
        }
    }
}

/* Whether cell (x,y) has the mesh on one side, nobody on another. */
static bool outline_is_rim(const float *rgba, const float *coverage, long n,
                          long x, long y)
{
    const long far = lroundf(0.5f * RIM * (float)n);
    const long near = lroundf(0.7071f * (float)far);
    const long step[8][2] = {
        {far, 0}, {near, near}, {0, far}, {-near, near},
        {-far, 0}, {-near, -near}, {0, -far}, {near, -near}
    };
    bool mesh = false, nobody = false;

    for (int i = 0; i < 8; i++) {
        const long u = x + step[i][0], v = y + step[i][1];

        if (u < 0 || v < 0 || u >= n || v >= n)
            continue;
        mesh |= coverage[v * n + u] >= OUTLINE_COVERED;
        nobody |= rgba[4 * (v * n + u) + 3] < NOBODY;
    }
    return mesh && nobody;
}

/* A row of cells. */
PARALLEL(outline_rim_part, y, const float *, rgba, const float *, coverage,
         float *, value, long, side)
{
    const size_t n = (size_t)side;

    for (size_t k = y * n; k < (y + 1) * n; k++)
        if (rgba[4 * k + 3] > 0 && coverage[k] < OUTLINE_COVERED &&
            outline_is_rim(rgba, coverage, side, (long)(k % n), (long)y))
            value[k] = 1;
}

void outline_rim(float *value, const float *rgba, const float *coverage,
                size_t n)
{
    const long side = (long)n;

    parallel_each(outline_rim_part, n, 1, rgba, coverage, value, side);
}
