/* Normal equations of small weighted least squares: rows are added one by one,
 * then solved freely or between bounds. */
#ifndef SPID_LAB_FIT_NORMAL_H
#define SPID_LAB_FIT_NORMAL_H

#include <stddef.h>

#include "lib/base/error.h"

/* The x (n) that makes sum_r weight_r (row_r x - value_r)^2 smallest:
 * a x = b with a (n,n), of which the lower triangle is kept. */
struct normal {
    size_t n;
    double *a, *b;
};

/* Equations in n unknowns, all zero. */
int normal_init(struct normal *e, size_t n, struct error *err);
/* Free what it holds; zeroed then. */
void normal_release(struct normal *e);
/* Zero again, for other rows. */
void normal_clear(struct normal *e);

/* One row (n) more; or a prior: x_k is about value. */
void normal_add(struct normal *e, const double *row, double weight,
                double value);
/* x_k is about value, as much as a row of this weight would say. */
void normal_prior(struct normal *e, size_t k, double weight, double value);

/* What e says about its first to->n unknowns when the others are left free
 * (the Schur complement), times weight, is added to `to`.  e is spent. */
void normal_reduce(struct normal *to, struct normal *e, double weight);

/* x (n) of a x = b by Cholesky's factors; a pivot that is not positive counts
 * as tiny.  e is spent. */
void normal_solve(double *x, struct normal *e);

/* The same with low <= x_k <= high, by coordinate descent from x as it comes
 * (inside the bounds) until no coordinate moves by more than `still`. */
void normal_solve_bounded(double *x, const struct normal *e, double low,
                          double high, double still);

#endif
