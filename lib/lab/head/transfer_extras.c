/* Principal components of what the sculpted head varies where the scans say
 * little. */
#include "lib/lab/head/transfer.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/jacobi.h"

enum { N = SCULPT_SHAPES, DIRS = SCULPT_SHAPES + SCULPT_EXPRESSIONS };

/* A (N,N) = X^T X of the masked identity columns, X (3 nv, N) in mm. */
static void extras_gram(double *A, const struct sculpt *s, const double *mask)
{
    for (size_t i = 0; i < 3 * s->nv; i++) {
        const float *x = s->shapedirs + i * DIRS;
        double w = 1e6 * mask[i / 3] * mask[i / 3];

        for (size_t a = 0; w > 0 && a < N; a++)
            for (size_t b = a; b < N; b++)
                A[a * N + b] += w * x[a] * x[b];
    }
    for (size_t a = 0; a < N; a++)
        for (size_t b = 0; b < a; b++)
            A[a * N + b] = A[b * N + a];
}

/* X V of the count largest eigenvalues, in place: column V_k has norm
 * sqrt(lambda_k), its standard deviation when the old coefficients are
 * standard normal. */
static int extras_rotate(struct sculpt *s, size_t first, size_t count,
                         const double *mask, const double *A, const double *V)
{
    size_t *order = malloc(N * sizeof *order);
    float row[N];

    if (!order)
        return -1;
    for (size_t k = 0; k < N; k++)
        order[k] = k;
    for (size_t k = 0; k < count; k++)      /* the largest first */
        for (size_t j = k + 1; j < N; j++)
            if (A[order[j] * (N + 1)] > A[order[k] * (N + 1)]) {
                size_t swap = order[k];

                order[k] = order[j];
                order[j] = swap;
            }
    for (size_t i = 0; i < 3 * s->nv; i++) {
        float *x = s->shapedirs + i * DIRS;

        memcpy(row, x, sizeof row);
        for (size_t k = 0; k < count; k++) {
            double sum = 0;

            for (size_t j = 0; j < N && mask[i / 3] > 0; j++)
                sum += row[j] * V[j * N + order[k]];
            x[first + k] = (float)(mask[i / 3] * sum);
        }
    }
    free(order);
    return 0;
}

int transfer_extras(struct sculpt *s, size_t first, size_t count,
                    const double *mask, struct error *err)
{
    double *A = calloc(2 * N * N, sizeof *A);
    int rc = -1;

    if (A) {
        double *V = A + N * N;

        extras_gram(A, s, mask);
        for (size_t k = 0; k < N; k++)
            V[k * N + k] = 1;
        double small = 1e-9 * A[0];
        for (int k = 0; k < 12 && jacobi_sweep(A, V, N) > small; k++)
            ;
        rc = extras_rotate(s, first, count, mask, A, V);
    }
    free(A);
    return rc ? error_set(err, EX_OSERR, "no memory for %d directions", N)
              : 0;
}
