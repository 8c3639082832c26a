/* Small symmetric systems, as normal equations give them. */
#ifndef SPID_BASE_CHOLESKY_H
#define SPID_BASE_CHOLESKY_H

#include <stddef.h>

#define CHOLESKY_PIVOT 1e-12

/* x (n) = a^-1 x by Cholesky's factors of the symmetric, positive definite a
 * (n,n), of which the lower triangle is read and overwritten.  A pivot under
 * CHOLESKY_PIVOT counts as that: where a is singular x stays finite, and large. */
void cholesky_solve(double *x, double *a, size_t n);

/* The same for the columns of x (n,cols). */
void cholesky_solve_columns(double *x, double *a, size_t n, size_t cols);

#endif
