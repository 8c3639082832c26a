/* Cholesky's decomposition a = L L^T in place, then both triangles solved. */
#include "lib/base/cholesky.h"

#include <math.h>

/* The lower triangle of a to its factor L. */
static void cholesky_factor(double *a, size_t n)
{
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j <= i; j++) {
            double s = a[i * n + j];

            for (size_t k = 0; k < j; k++)
                s -= a[i * n + k] * a[j * n + k];
            a[i * n + j] = i == j ? sqrt(fmax(s, CHOLESKY_PIVOT))
                                  : s / a[j * n + j];
        }
}

/* n numbers of x, `step` apart, to L^-T L^-1 of them. */
static void cholesky_apply(double *x, size_t step, const double *a, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 0; k < i; k++)
            x[i * step] -= a[i * n + k] * x[k * step];
        x[i * step] /= a[i * n + i];
    }
    for (size_t i = n; i-- > 0;) {
        for (size_t k = i + 1; k < n; k++)
            x[i * step] -= a[k * n + i] * x[k * step];
        x[i * step] /= a[i * n + i];
    }
}

void cholesky_solve(double *x, double *a, size_t n)
{
    cholesky_factor(a, n);
    cholesky_apply(x, 1, a, n);
}

void cholesky_solve_columns(double *x, double *a, size_t n, size_t cols)
{
    cholesky_factor(a, n);
    for (size_t c = 0; c < cols; c++)
        cholesky_apply(x + c, cols, a, n);
}
