/* Runs out of dense directions and dense directions out of runs, checked. */
#include "lib/head/runs.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

/* A gap this short costs less than a new run. */
enum { GAP = 2 };

static int run_moves(const float *dirs, size_t K, size_t v, size_t k,
                     double least)
{
    double x = dirs[3 * v * K + k], y = dirs[(3 * v + 1) * K + k];
    double z = dirs[(3 * v + 2) * K + k];

    return x * x + y * y + z * z >= least * least && (x || y || z);
}

/* The end of the run of direction k that begins at v. */
static size_t run_end(const float *dirs, size_t V, size_t K, size_t v,
                      size_t k, double least)
{
    size_t end = v + 1;

    for (size_t u = v + 1; u < V && u <= end + GAP; u++)
        if (run_moves(dirs, K, u, k, least))
            end = u + 1;
    return end;
}

int runs_pack(struct runs *r, const float *dirs, size_t V, size_t K,
              double least, struct error *err)
{
    for (int pass = 0; pass < 2; pass++) {      /* count, then fill */
        size_t n = 0, rows = 0;

        for (size_t k = 0; k < K; k++)
            for (size_t v = 0; v < V; v++) {
                if (!run_moves(dirs, K, v, k, least))
                    continue;
                size_t end = run_end(dirs, V, K, v, k, least);
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

float *runs_unpack(const int32_t *run, size_t n, const float *value,
                   size_t rows, size_t V, size_t K, struct error *err)
{
    float *dirs = calloc(3 * V * K + 1, sizeof *dirs);
    size_t at = 0;

    if (!dirs) {
        error_set(err, EX_OSERR, "no memory for %zu directions", K);
        return NULL;
    }
    for (size_t i = 0; i < n; i++, run += 3) {
        size_t k = (size_t)run[0], v = (size_t)run[1], m = (size_t)run[2];

        if (run[0] < 0 || run[1] < 0 || run[2] < 1 || k >= K || v >= V ||
            m > V - v || m > rows - at) {
            error_set(err, EX_DATAERR, "run %zu is %d %d %d (expected a "
                      "direction under %zu and vertices under %zu, %zu values "
                      "left)", i, run[0], run[1], run[2], K, V, rows - at);
            free(dirs);
            return NULL;
        }
        for (; m > 0; m--, v++, at++)
            for (size_t c = 0; c < 3; c++)
                dirs[(3 * v + c) * K + k] = value[3 * at + c];
    }
    if (at != rows) {
        error_set(err, EX_DATAERR, "runs use %zu values (expected %zu, all)",
                  at, rows);
        free(dirs);
        return NULL;
    }
    return dirs;
}
