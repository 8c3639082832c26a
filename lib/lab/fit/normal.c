/* Cholesky's decomposition of the normal equations, and the bounded solution
 * by coordinate descent. */
#include "lib/lab/fit/normal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/cholesky.h"

#define NORMAL_SWEEPS 200

int normal_init(struct normal *e, size_t n, struct error *err)
{
    e->n = n;
    e->a = calloc(n * n + n, sizeof *e->a);
    if (!e->a)
        return error_set(err, EX_OSERR, "out of memory (%zu unknowns)", n);
    e->b = e->a + n * n;
    return 0;
}

void normal_release(struct normal *e)
{
    free(e->a);
    memset(e, 0, sizeof *e);
}

void normal_clear(struct normal *e)
{
    memset(e->a, 0, (e->n * e->n + e->n) * sizeof *e->a);
}

void normal_add(struct normal *e, const double *row, double weight,
                double value)
{
    for (size_t i = 0; i < e->n; i++) {
        double w = weight * row[i], *a = e->a + i * e->n;

        if (w == 0)
            continue;
        for (size_t k = 0; k <= i; k++)
            a[k] += w * row[k];
        e->b[i] += w * value;
    }
}

void normal_prior(struct normal *e, size_t k, double weight, double value)
{
    e->a[k * e->n + k] += weight;
    e->b[k] += weight * value;
}

/* Unknown k, the last one left, is expressed by those before it. */
static void normal_eliminate(struct normal *e, size_t k)
{
    const double *row = e->a + k * e->n;
    double pivot = fmax(row[k], CHOLESKY_PIVOT);

    for (size_t i = 0; i < k; i++) {
        double w = row[i] / pivot, *a = e->a + i * e->n;

        for (size_t j = 0; j <= i; j++)
            a[j] -= w * row[j];
        e->b[i] -= w * e->b[k];
    }
}

void normal_reduce(struct normal *to, struct normal *e, double weight)
{
    for (size_t k = e->n; k-- > to->n;)
        normal_eliminate(e, k);
    for (size_t i = 0; i < to->n; i++) {
        for (size_t k = 0; k <= i; k++)
            to->a[i * to->n + k] += weight * e->a[i * e->n + k];
        to->b[i] += weight * e->b[i];
    }
}

void normal_solve(double *x, struct normal *e)
{
    memmove(x, e->b, e->n * sizeof *x);
    cholesky_solve(x, e->a, e->n);
}

/* Row k of a times x. */
static double normal_row(const struct normal *e, size_t k, const double *x)
{
    double s = 0;

    for (size_t i = 0; i < e->n; i++)
        s += (i <= k ? e->a[k * e->n + i] : e->a[i * e->n + k]) * x[i];
    return s;
}

void normal_solve_bounded(double *x, const struct normal *e, double low,
                          double high, double still)
{
    double moved = still + 1;

    for (int sweep = 0; moved > still && sweep < NORMAL_SWEEPS; sweep++) {
        moved = 0;
        for (size_t k = 0; k < e->n; k++) {
            double pivot = fmax(e->a[k * e->n + k], CHOLESKY_PIVOT);
            double to = x[k] + (e->b[k] - normal_row(e, k, x)) / pivot;

            to = fmin(fmax(to, low), high);
            moved = fmax(moved, fabs(to - x[k]));
            x[k] = to;
        }
    }
}
