/* Runs out of dense directions and dense directions out of runs, checked. */
#include "lib/head/runs.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/half.h"

/* A gap this short costs less than a new run. */
enum { GAP = 2 };

/* Whether direction k moves vertex v by `min` or more. */
static int runs_moves(const float *dirs, size_t K, size_t v, size_t k,
                      double min)
{
    double x = dirs[3 * v * K + k], y = dirs[(3 * v + 1) * K + k];
    double z = dirs[(3 * v + 2) * K + k];

    return x * x + y * y + z * z >= min * min && (x || y || z);
}

/* The end of the run of direction k that begins at v. */
static size_t runs_end(const float *dirs, size_t V, size_t K, size_t v,
                       size_t k, double min)
{
    size_t end = v + 1;

    for (size_t u = v + 1; u < V && u <= end + GAP; u++)
        if (runs_moves(dirs, K, u, k, min))
            end = u + 1;
    return end;
}

int runs_pack(struct runs *r, const float *dirs, size_t V, size_t K,
              double min, struct error *err)
{
    for (int pass = 0; pass < 2; pass++) {      /* count, then fill */
        size_t n = 0, rows = 0;

        for (size_t k = 0; k < K; k++)
            for (size_t v = 0; v < V; v++) {
                if (!runs_moves(dirs, K, v, k, min))
                    continue;
                size_t end = runs_end(dirs, V, K, v, k, min);
                if (pass) {
                    r->run[3 * n] = (int32_t)k;
                    r->run[3 * n + 1] = (int32_t)v;
                    r->run[3 * n + 2] = (int32_t)(end - v);
                }
                n++;
                for (; v < end; v++, rows++)
                    for (size_t c = 0; pass && c < 3; c++)
                        r->value[3 * rows + c] =
                            float_to_half(dirs[(3 * v + c) * K + k]);
            }
        if (pass)
            break;
        *r = (struct runs){ malloc((3 * n + 1) * sizeof *r->run), n,
                            malloc((3 * rows + 1) * sizeof *r->value), rows };
        if (!r->run || !r->value) {
            runs_release(r);
            return error_set(err, EX_OSERR, "no memory for %zu rows", rows);
        }
    }
    return 0;
}

void runs_release(struct runs *r)
{
    free(r->run);
    free(r->value);
    memset(r, 0, sizeof *r);
}

int runs_check(const struct runs_read *r, struct error *err)
{
    const int32_t *run = r->run;
    size_t at = 0;

    for (size_t i = 0; i < r->n; i++, run += 3) {
        size_t k = (size_t)run[0], v = (size_t)run[1], m = (size_t)run[2];

        if (run[0] < 0 || run[1] < 0 || run[2] < 1 || k >= r->K ||
            v >= r->V || m > r->V - v || m > r->rows - at)
            return error_set(err, EX_DATAERR, "run %zu is %d %d %d (expected "
                             "a direction under %zu and vertices under %zu, "
                             "%zu values left)", i, run[0], run[1], run[2],
                             r->K, r->V, r->rows - at);
        at += m;
    }
    return at == r->rows ? 0 : error_set(err, EX_DATAERR, "runs use %zu "
        "values (expected %zu, all)", at, r->rows);
}

/* Column k of dirs (n,3,K) from n vertices' halves. */
static void runs_unpack_column(float *dirs, size_t K, size_t k,
                               const char *half, size_t n)
{
    enum { SOME = 64 };
    float value[3 * SOME];

    for (size_t v = 0; v < n; v += SOME) {
        const size_t some = n - v < SOME ? n - v : SOME;

        half_to_floats(value, half + 6 * v, 3 * some);
        for (size_t i = 0; i < 3 * some; i++)
            dirs[(3 * v + i) * K + k] = value[i];
    }
}

void runs_unpack_some(float *dirs, const struct runs_read *r, size_t from,
                      size_t to)
{
    const int32_t *run = r->run;
    const char *half = r->value;

    for (size_t i = 0; i < r->n; i++, run += 3) {
        const size_t begin = (size_t)run[1], end = begin + (size_t)run[2];
        const size_t v = begin < from ? from : begin;
        const size_t stop = end < to ? end : to;

        if (v < stop)
            runs_unpack_column(dirs + 3 * (v - from) * r->K, r->K,
                               (size_t)run[0], half + 6 * (v - begin),
                               stop - v);
        half += 6 * (end - begin);
    }
}

float *runs_unpack(const struct runs_read *r, struct error *err)
{
    if (runs_check(r, err))
        return NULL;
    float *dirs = calloc(3 * r->V * r->K + 1, sizeof *dirs);

    if (dirs)
        runs_unpack_some(dirs, r, 0, r->V);
    else
        error_set(err, EX_OSERR, "no memory for %zu directions", r->K);
    return dirs;
}
