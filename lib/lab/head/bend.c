/* The radial basis that bends a mesh through its controls: |r| plus an
 * affine map, the smoothest such bending there is. */
#include "lib/lab/head/bend.h"

#include <math.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/arena.h"
#include "lib/base/rotation.h"

/* Solve A X = B, A (n,n), B (n,3), in place, with the largest pivot. */
static int bend_solve(double *A, double *B, size_t n)
{
    for (size_t k = 0; k < n; k++) {
        size_t best = k;

        for (size_t i = k + 1; i < n; i++)
            if (fabs(A[i * n + k]) > fabs(A[best * n + k]))
                best = i;
        if (fabs(A[best * n + k]) < 1e-14)
            return -1;
        for (size_t j = 0; best != k && j < n + 3; j++) {
            double *x = j < n ? A + k * n + j : B + k * 3 + j - n;
            double *y = j < n ? A + best * n + j : B + best * 3 + j - n;
            double swap = *x;

            *x = *y;
            *y = swap;
        }
        for (size_t i = 0; i < n; i++) {
            double f = i == k ? 0 : A[i * n + k] / A[k * n + k];

            for (size_t j = k; f != 0 && j < n; j++)
                A[i * n + j] -= f * A[k * n + j];
            for (size_t j = 0; f != 0 && j < 3; j++)
                B[i * 3 + j] -= f * B[k * 3 + j];
        }
    }
    for (size_t i = 0; i < 3 * n; i++)
        B[i] /= A[i / 3 * n + i / 3];
    return 0;
}

/* d(p) = sum_i w_i |p - from_i| + a + A p, through to - from at the controls
 * but for `slack` metres of give. */
int bend_mesh(double *at, size_t n, const struct control *c, size_t count,
              struct error *err)
{
    const double slack = 1e-4;
    size_t m = count + 4;
    struct arena room = {0};
    double *A = arena_take(&room, m * m, sizeof *A);
    double *B = arena_take(&room, 3 * m, sizeof *B);
    int rc = arena_check(&room, "controls", err);

    if (rc)
        goto out;
    for (size_t i = 0; i < count; i++) {
        for (size_t j = 0; j < count; j++)
            A[i * m + j] = distance3_d(c[i].from, c[j].from);
        A[i * m + i] -= slack;
        for (size_t k = 0; k < 4; k++)
            A[i * m + count + k] = A[(count + k) * m + i] =
                k ? c[i].from[k - 1] : 1;
        for (size_t k = 0; k < 3; k++)
            B[3 * i + k] = c[i].to[k] - c[i].from[k];
    }
    rc = !bend_solve(A, B, m) ? 0 :
             error_set(err, EX_DATAERR, "the controls do not span a space "
                       "(expected four apart)");
    for (size_t v = 0; !rc && v < n; v++) {
        double p[3], *x = at + 3 * v;

        memcpy(p, x, sizeof p);
        for (size_t i = 0; i < m; i++) {
            double k = i < count ? distance3_d(p, c[i].from)
                     : i == count ? 1 : p[i - count - 1];

            for (int d = 0; d < 3; d++)
                x[d] += k * B[3 * i + (size_t)d];
        }
    }
out:
    arena_release(&room);
    return rc;
}
