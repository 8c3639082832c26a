/* Golden 08: 6D and axis-angle rotations and their gradients. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/rotation.h"
#include "tests/golden/golden.h"

struct form {
    const char *suffix;         /* of the group: "" or ".quat" */
    size_t n;                   /* numbers per input row */
    void (*forward)(double *R, const double *x);
    void (*backward)(double *dx, const double *dR, const double *x);
    void (*forward_f)(float *R, const float *x);      /* NULL: double only, */
    void (*backward_f)(float *dx, const float *dR, const float *x);
    double grad_rel;            /* tolerance of the double gradient */
};

static void rotation_d6(double *R, const double *x) { rotation_6d_d(R, x); }
static void d6_back(double *dx, const double *dR, const double *x)
{
    rotation_6d_backward_d(dx, dR, x);
}
static void d6_f(float *R, const float *x) { rotation_6d(R, x); }
static void d6_back_f(float *dx, const float *dR, const float *x)
{
    rotation_6d_backward(dx, dR, x);
}
static void rotation_aa(double *R, const double *x) { rotation_exp_d(R, x); }
static void aa_back(double *dx, const double *dR, const double *x)
{
    rotation_exp_backward_d(dx, dR, x);
}
static void aa_f(float *R, const float *x) { rotation_exp(R, x); }
static void rotation_eps(double *R, const double *x)
{
    rotation_rodrigues_eps_d(R, x);
}
static void eps_back(double *dx, const double *dR, const double *x)
{
    rotation_rodrigues_eps_backward_d(dx, dR, x);
}

/* The worst row of x (rows,m) against NAME, as error over NAME.rowtol; with
 * rel > 0 the row's tolerance is rel times its largest true value instead. */
static void compare_rows(struct golden *g, const char *name, const double *x,
                         size_t rows, size_t m, double rel, const char *kind)
{
    char key[160];

    snprintf(key, sizeof key, "%s.rowtol", name);
    double *truth = golden_f64(g, name, NULL);
    double *tol = golden_f64(g, key, NULL);
    double worst = 0, at = 0, tol_at = 1;

    for (size_t r = 0; r < rows; r++) {
        double e = 0, big = 1e-300;

        for (size_t i = 0; i < m; i++) {
            double d = fabs(x[r * m + i] - truth[r * m + i]);

            e = d >= e || isnan(d) ? d : e;
            big = fmax(big, fabs(truth[r * m + i]));
        }
        double t = rel > 0 ? rel * big : tol[r];
        if (!(e / t <= worst)) {
            worst = e / t;
            at = e;
            tol_at = t;
        }
    }
    snprintf(key, sizeof key, "%s %s", name, kind);
    golden_check(g, key, at, worst, tol_at);
    free(truth);
    free(tol);
}

static void run_group(struct golden *g, const char *group,
                      const struct form *f)
{
    char name[128];
    size_t count, n = f->n;

    snprintf(name, sizeof name, "%s.x", group);
    float *xf = golden_f32(g, name, &count);
    size_t rows = count / n;
    double *x = calloc(rows * n, sizeof *x), *dx = calloc(rows * n, sizeof *x);
    double *R = calloc(rows * 9, sizeof *R), *Rf = calloc(rows * 9, sizeof *R);
    double *dxf = calloc(rows * n, sizeof *x);
    for (size_t r = 0; r < rows; r++) {
        double dR[9];
        float R32[9], dR32[9], dx32[6] = {0};

        for (size_t i = 0; i < n; i++)
            x[r * n + i] = xf[r * n + i];
        for (size_t i = 0; i < 9; i++) {
            dR[i] = golden_probe(g->seed, r * 9 + i);
            dR32[i] = (float)dR[i];
        }
        f->forward(R + 9 * r, x + n * r);
        f->backward(dx + n * r, dR, x + n * r);
        if (!f->forward_f)
            continue;
        f->forward_f(R32, xf + n * r);
        if (f->backward_f)
            f->backward_f(dx32, dR32, xf + n * r);
        for (size_t i = 0; i < 9; i++)
            Rf[9 * r + i] = R32[i];
        for (size_t i = 0; i < n; i++)
            dxf[n * r + i] = dx32[i];
    }
    snprintf(name, sizeof name, "%s%s.R", group, f->suffix);
    compare_rows(g, name, R, rows, 9, 1e-9, "f64");
    if (f->forward_f)
        compare_rows(g, name, Rf, rows, 9, 0, "f32");
    snprintf(name, sizeof name, "%s%s.grad", group, f->suffix);
    compare_rows(g, name, dx, rows, n, f->grad_rel, "f64");
    if (f->backward_f)
        compare_rows(g, name, dxf, rows, n, 0, "f32");
    free(xf);
    free(x);
    free(dx);
    free(dxf);
    free(R);
    free(Rf);
}

static void run_rotation(struct golden *g)
{
    static const struct form six = {"",   6,         rotation_d6, d6_back,
                                    d6_f, d6_back_f, 1e-9};
    static const struct form exact = {".quat", 3, rotation_aa, aa_back, aa_f,
                                      NULL, 1e-9};
    static const struct form shifted
        = {".rodrigues_eps", 3, rotation_eps, eps_back, NULL, NULL, 1e-7};
    static const char *const d6_groups[] = {"d6.rand", "d6.ident",
                                            "d6.nearpar", "d6.tiny",
                                            "d6.degen"};
    static const char *const aa_groups[] = {"aa.rand", "aa.small",
                                            "aa.nearpi", "aa.big", "aa.axis"};

    for (size_t i = 0; i < 5; i++)
        run_group(g, d6_groups[i], &six);
    for (size_t i = 0; i < 5; i++) {
        run_group(g, aa_groups[i], &exact);
        run_group(g, aa_groups[i], &shifted);
    }
}

GOLDEN_CASE("08_rotation", run_rotation)
