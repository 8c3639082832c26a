/* Jacobi's rotations: each makes one entry off the diagonal zero (Golub and
 * Van Loan, Matrix Computations, 8.5). */
#include "lib/lab/people/jacobi.h"

#include <math.h>

#define JACOBI_ZERO 1e-16       /* smaller entries are left */

/* The n numbers at x and at y, `step` apart, turned into each other by the
 * angle of cosine c and sine s: two columns of a matrix, or two rows. */
static void jacobi_turn(double *x, double *y, size_t n, size_t step, double c,
                        double s)
{
    for (size_t i = 0; i < n; i++) {
        double a = x[i * step], b = y[i * step];

        x[i * step] = c * a - s * b;
        y[i * step] = s * a + c * b;
    }
}

double jacobi_sweep(double *a, double *v, size_t n)
{
    double worst = 0;

    for (size_t p = 0; p < n; p++)
        for (size_t q = p + 1; q < n; q++) {
            double apq = a[p * n + q];

            worst = fmax(worst, fabs(apq));
            if (fabs(apq) < JACOBI_ZERO)
                continue;
            double th = (a[q * n + q] - a[p * n + p]) / (2 * apq);
            double t = (th < 0 ? -1 : 1) / (fabs(th) + sqrt(th * th + 1));
            double c = 1 / sqrt(t * t + 1), s = t * c;

            jacobi_turn(a + p, a + q, n, n, c, s);
            jacobi_turn(a + p * n, a + q * n, n, 1, c, s);
            jacobi_turn(v + p, v + q, n, n, c, s);
        }
    return worst;
}
