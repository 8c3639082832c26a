#include "lib/head/mirror.h"

#include <math.h>
#include <stdlib.h>
#include <sysexits.h>

/* The vertex of the mean head nearest to the mirror image of vertex v. */
static size_t opposite(const struct head *h, size_t v)
{
    const float *x = h->v_template + 3 * v;
    float least = INFINITY;
    size_t best = v;

    for (size_t w = 0; w < h->V; w++) {
        const float *y = h->v_template + 3 * w;
        float a = x[0] + y[0], b = x[1] - y[1], c = x[2] - y[2];
        float far = a * a + b * b + c * c;

        if (far < least) {
            least = far;
            best = w;
        }
    }
    return best;
}

/* Coordinate c of what shape direction k does to vertex v. */
static double moved(const struct head *h, size_t k, size_t v, size_t c)
{
    return (double)h->shape_dirs[(v / HEAD_BLOCK * h->nshape + k) * 3 *
                                 HEAD_BLOCK + c * HEAD_BLOCK +
                                 v % HEAD_BLOCK];
}

/* 1 or -1 when direction k is its own mirror image, or that with the other
 * sign; else 0. */
static int parity(const struct head *h, size_t k, const size_t *other)
{
    double with = 0, own = 0;

    for (size_t v = 0; v < h->V; v++)
        for (size_t c = 0; c < 3; c++) {
            double a = moved(h, k, v, c), b = moved(h, k, other[v], c);

            own += a * a;
            with += c ? a * b : -a * b;
        }
    if (fabs(with) < 0.9999 * own)
        return 0;
    return with < 0 ? -1 : 1;
}

int head_mirror(float *sign, const struct head *h, struct error *err)
{
    size_t *other = malloc(h->V * sizeof *other);
    int symmetric = 1;

    if (!other)
        return error_set(err, EX_OSERR, "no memory for %zu vertices", h->V);
    for (size_t v = 0; v < h->V; v++)
        other[v] = opposite(h, v);
    for (size_t k = 0; k < h->nshape && symmetric; k++) {
        int p = parity(h, k, other);

        sign[k] = (float)p;
        symmetric = p != 0;
    }
    free(other);
    return symmetric;
}
