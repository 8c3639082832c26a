/* Frechet and kernel distances of features, in double. */
#include "lib/lab/eval/distribution.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/npy.h"
#include "lib/base/vec3.h"
#include "lib/stream/stats.h"

/* ---- Frechet -------------------------------------------------------------- */

/* x (n,dim) = rows of a less their mean (dim), over sqrt(n - 1): x^T x is their
 * covariance. */
static void distribution_centre(double *x, double *mean, const double *a,
                                size_t n, size_t dim)
{
    memset(mean, 0, dim * sizeof *mean);
    for (size_t i = 0; i < n * dim; i++)
        mean[i % dim] += a[i] / (double)n;
    for (size_t i = 0; i < n * dim; i++)
        x[i] = (a[i] - mean[i % dim]) / sqrt((double)(n - 1));
}

/* x (n,dim) -> its first dim rows: the transposed Cholesky factor r of x^T x
 * (r^T r = x^T x), for n > dim; g (dim,dim) is scratch.  A pivot that rounding
 * leaves under 0 is 0. */
static void distribution_shorten(double *x, double *g, size_t n, size_t dim)
{
    memset(g, 0, dim * dim * sizeof *g);
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < dim; j++)
            for (size_t k = 0; k <= j; k++)
                g[j * dim + k] += x[i * dim + j] * x[i * dim + k];
    for (size_t j = 0; j < dim; j++)
        for (size_t k = 0; k <= j; k++) {
            const double v = g[j * dim + k] - dot_many(g + j * dim,
                                                               g + k * dim, k);
            const double pivot = g[k * dim + k];

            g[j * dim + k] = j == k ? sqrt(fmax(v, 0))
                             : pivot > 0 ? v / pivot : 0;
        }
    for (size_t j = 0; j < dim; j++)
        for (size_t k = 0; k < dim; k++)
            x[k * dim + j] = k <= j ? g[j * dim + k] : 0;
}

/* Sum of the singular values of m (rows,n), which is overwritten: rows are
 * turned in pairs until all are orthogonal (one-sided Jacobi), and then as long
 * as these.  A row of 1e-14 of all is rounding, and stays. */
static double distribution_nuclear(double *m, size_t rows, size_t n)
{
    const double least = 1e-28 * dot_many(m, m, rows * n);
    double sum = 0;
    bool turned = true;

    while (turned) {
        turned = false;
        for (size_t p = 0; p < rows; p++)
            for (size_t q = p + 1; q < rows; q++) {
                double *x = m + p * n, *y = m + q * n;
                const double xx = dot_many(x, x, n);
                const double yy = dot_many(y, y, n);
                const double xy = dot_many(x, y, n);

                if (!(fabs(xy) > 1e-12 * sqrt(xx) * sqrt(yy)) ||
                    fmin(xx, yy) < least)
                    continue;
                const double z = (yy - xx) / (2 * xy);
                const double t = copysign(1, z) / (fabs(z) + sqrt(1 + z * z));
                const double c = 1 / sqrt(1 + t * t), s = c * t;

                turned = true;
                for (size_t k = 0; k < n; k++) {
                    const double u = x[k];

                    x[k] = c * u - s * y[k];
                    y[k] = s * u + c * y[k];
                }
            }
    }
    for (size_t p = 0; p < rows; p++)
        sum += sqrt(dot_many(m + p * n, m + p * n, n));
    return sum;
}

/* fid; x and y are scratch of max(n, dim) rows each, m of their product and of
 * (dim,dim), mean (2,dim).  tr (Sa Sb)^1/2 is the sum of the singular values of
 * x y^T where Sa = x^T x, Sb = y^T y. */
static double distribution_frechet(const double *a, size_t na, const double *b,
                                   size_t nb, size_t dim, double *x, double *y,
                                   double *m, double *mean)
{
    double fid = 0;

    distribution_centre(x, mean, a, na, dim);
    distribution_centre(y, mean + dim, b, nb, dim);
    for (size_t k = 0; k < dim; k++)
        fid += (mean[k] - mean[dim + k]) * (mean[k] - mean[dim + k]);
    fid += dot_many(x, x, na * dim) + dot_many(y, y, nb * dim);
    if (na > dim)
        distribution_shorten(x, m, na, dim);
    if (nb > dim)
        distribution_shorten(y, m, nb, dim);
    na = na > dim ? dim : na;
    nb = nb > dim ? dim : nb;
    for (size_t i = 0; i < na * nb; i++)
        m[i] = dot_many(x + i / nb * dim, y + i % nb * dim, dim);
    return fid - 2 * distribution_nuclear(m, na, nb);
}

/* ---- kernel --------------------------------------------------------------- */

/* Mean of (x.y / dim + 1)^3 over rows of a and rows of b; the same rows: over
 * pairs of different ones. */
static double distribution_kernel(const double *a, size_t na, const double *b,
                                  size_t nb, size_t dim)
{
    const bool same = a == b;
    double sum = 0;

    for (size_t i = 0; i < na; i++)
        for (size_t j = 0; j < nb; j++) {
            const double dot = dot_many(a + i * dim, b + j * dim, dim);

            sum += same && i == j ? 0 : pow(dot / (double)dim + 1, 3);
        }
    return sum / (double)(na * (same ? nb - 1 : nb));
}

/* Columns fid and kid of the row, of features a (na,dim) and b (nb,dim). */
static int distribution_add(struct table *t, size_t row, const double *a,
                            size_t na, const double *b, size_t nb, size_t dim,
                            struct error *err)
{
    const size_t sa = na > dim ? dim : na, sb = nb > dim ? dim : nb;
    const size_t m = sa * sb > dim * dim ? sa * sb : dim * dim;
    double *x = malloc((na * dim + nb * dim + m + 2 * dim) * sizeof *x);

    if (!x)
        return error_set(err, EX_OSERR, "out of memory");
    table_add(t, row, table_column(t, "fid", -1),
              distribution_frechet(a, na, b, nb, dim, x, x + na * dim,
                                   x + (na + nb) * dim,
                                   x + (na + nb) * dim + m));
    table_add(t, row, table_column(t, "kid", -1),
              distribution_kernel(a, na, a, na, dim) +
                  distribution_kernel(b, nb, b, nb, dim) -
                  2 * distribution_kernel(a, na, b, nb, dim));
    free(x);
    return 0;
}

/* ---- files ---------------------------------------------------------------- */

/* Rows of dim numbers, for the caller to free; NULL. */
static double *distribution_load(size_t *rows, size_t *dim, const char *path,
                                 struct error *err)
{
    struct npy a = {0};
    double *v = NULL;

    if (npy_load(&a, path, err))
        return NULL;
    const struct array view = array_make("", a.dtype, a.data, a.ndim, a.dim[0],
                                         a.dim[1], 0, 0);

    if (a.ndim != 2 || a.dim[0] < 2 || !a.dim[1]) {
        error_set(err, EX_DATAERR, "%s: no features (expected numbers [N,dim], "
                  "two rows or more)", path);
        goto out;
    }
    *rows = a.dim[0];
    *dim = a.dim[1];
    v = malloc(*rows * *dim * sizeof *v);
    if (!v)
        error_set(err, EX_OSERR, "out of memory");
    for (size_t i = 0; v && i < *rows * *dim; i++) {
        v[i] = array_value(&view, i);
        if (isfinite(v[i]))
            continue;
        error_set(err, EX_DATAERR, "%s: row %zu: not finite", path, i / *dim);
        free(v);
        v = NULL;
    }
out:
    npy_release(&a);
    return v;
}

int distribution_compare(struct table *t, size_t row, const char *truth,
                         const char *result, struct error *err)
{
    size_t na, nb, da, db;
    double *a = distribution_load(&na, &da, truth, err);
    double *b = a ? distribution_load(&nb, &db, result, err) : NULL;
    int rc = -1;

    if (b && da != db)
        error_set(err, EX_DATAERR, "%s: %zu numbers a row (expected %zu as in "
                  "%s)", result, db, da, truth);
    else if (b)
        rc = distribution_add(t, row, a, na, b, nb, da, err);
    free(a);
    free(b);
    return rc;
}
