/* Packed directions: what comes back, and runs that lie are refused. */
#include "lib/head/runs.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/random.h"
#include "tests/check.h"

enum { V = 97, K = 11 };

/* Columns that are empty, full, or hold islands of vertices. */
static void runs_draw(float *dirs, struct random *r)
{
    for (size_t k = 0; k < K; k++)
        for (size_t v = 0; v < V; v++) {
            double on = k == 0 ? 0 : k == 1 ? 1 : v / 7 % k == 1;

            for (size_t c = 0; c < 3; c++)
                dirs[(3 * v + c) * K + k] =
                    (float)(on * random_range(r, -0.01, 0.01));
        }
}

/* The directions that r's values and n runs stand for; NULL: refused. */
static float *runs_back(const struct runs *r, const int32_t *run, size_t n,
                        struct error *err)
{
    return runs_unpack(&(struct runs_read){run, n, r->value, r->rows, V, K},
                       err);
}

static void test_round_trip(const float *dirs, const struct runs *r)
{
    struct error err = { 0 };
    float *d = runs_back(r, r->run, r->n, &err);
    double worst = 0;

    for (size_t i = 0; d && i < 3 * V * K; i++)
        worst = fmax(worst, fabs(d[i] - dirs[i]));
    check_range("unpacked", d != NULL, 1, 1);
    /* half an ulp of a half float under 2^-6 */
    check_range("off by", worst, 0, 4e-6);
    check_range("rows, of 97 x 11", (double)r->rows, 97, 500);
    free(d);
}

/* Some vertices at a time, windows that cut runs: the same directions. */
static void test_windows(const struct runs *r)
{
    enum { SOME = 5 };
    struct error err = { 0 };
    float *whole = runs_back(r, r->run, r->n, &err), window[3 * SOME * K];
    const struct runs_read in = { r->run, r->n, r->value, r->rows, V, K };
    int same = 0;

    if (!whole)
        exit(1);
    for (size_t v = 0; v < V; v += SOME) {
        const size_t to = v + SOME < V ? v + SOME : V;

        memset(window, 0, sizeof window);
        runs_unpack_some(window, &in, v, to);
        same += !memcmp(window, whole + 3 * v * K,
                        3 * (to - v) * K * sizeof *window);
    }
    check_range("windows that agree", same, (V + SOME - 1) / SOME,
                (V + SOME - 1) / SOME);
    free(whole);
}

/* One number of one run changed. */
static void test_damage(const struct runs *r)
{
    static const struct { int field; int32_t value; } cases[] = {
        { 0, -1 }, { 0, K }, { 1, -1 }, { 1, V }, { 2, 0 }, { 2, -5 },
        { 2, V + 1 }, { 2, INT32_MAX },
    };
    int32_t *run = malloc((3 * r->n + 1) * sizeof *run);
    int refused = 0, told = 0;

    if (!run)
        exit(1);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct error err = { 0 };

        memcpy(run, r->run, 3 * r->n * sizeof *run);
        run[3 + cases[i].field] = cases[i].value;
        float *d = runs_back(r, run, r->n, &err);
        refused += !d;
        told += strstr(err.text, "run 1 is") != NULL;
        free(d);
    }
    check_range("damaged runs refused", refused, 8, 8);
    check_range("and named", told, 8, 8);
    struct error err = { 0 };
    float *d = runs_back(r, r->run, r->n - 1, &err);
    check_that("a run too few is refused", !d && strstr(err.text, "all"));
    free(d);
    free(run);
}

int main(void)
{
    float *dirs = calloc(3 * V * K, sizeof *dirs);
    struct runs r = { 0 };
    struct random random;

    random_init(&random, 3, "head_runs");
    if (!dirs)
        return 1;
    runs_draw(dirs, &random);
    if (runs_pack(&r, dirs, V, K, 1e-6, NULL))
        return 1;
    test_round_trip(dirs, &r);
    test_windows(&r);
    test_damage(&r);
    runs_release(&r);
    free(dirs);
    return check_status();
}
