/* 07_splat: projection, pictures and gradients of the double reference under
 * all three rules, and of the kernels under the two they draw by. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/splat/splat.h"
#include "tests/golden/golden.h"
#include "tests/reference/splat_backward.h"

struct scene {
    size_t N, C, W, H;
    float *color, *means, *scales, *quats, *opacities, *bg;
    float *probe;                 /* (H,W,C) */
    struct gaussians g;
    struct splat_camera cam;
};

static void scene_open(struct scene *s, struct golden *g)
{
    double *size = golden_f64(g, "size", NULL);
    float *T = golden_f32(g, "T", NULL);

    s->W = (size_t)size[0];
    s->H = (size_t)size[1];
    s->N = (size_t)size[2];
    s->C = (size_t)size[3];
    s->means = golden_f32(g, "means", NULL);
    s->scales = golden_f32(g, "scales", NULL);
    s->quats = golden_f32(g, "quats", NULL);
    s->opacities = golden_f32(g, "opacities", NULL);
    s->bg = golden_f32(g, "bg", NULL);
    s->color = golden_has(g, "colors")
        ? golden_f32(g, "colors", NULL)
        : golden_array("input.colors", g->seed, s->N * s->C, 0.5, 0.5);
    s->g = (struct gaussians){
        .n = s->N, .channels = (int)s->C, .mean = s->means,
        .scale = s->scales, .quat = s->quats, .opacity = s->opacities,
        .color = s->color};
    /* w2c = diag(-1,-1,1) [R^T | t] of the row-vector T */
    for (int r = 0; r < 3; r++) {
        for (int k = 0; k < 3; k++)
            s->cam.rt[4 * r + k] = (r < 2 ? -1 : 1) * T[4 * k + r];
        s->cam.rt[4 * r + 3] = (r < 2 ? -1 : 1) * T[4 * r + 3];
    }
    s->cam.fx = 6.0f * (float)s->W;
    s->cam.fy = 6.0f * (float)s->H;
    s->cam.cx = 0.5f * (float)s->W;
    s->cam.cy = 0.5f * (float)s->H;
    float *probe = golden_probe_array(g->seed, s->C * s->H * s->W);

    s->probe = calloc(s->C * s->H * s->W + 1, sizeof *s->probe);
    for (size_t c = 0; c < s->C; c++)
        for (size_t p = 0; p < s->H * s->W; p++)
            s->probe[p * s->C + c] = probe[c * s->H * s->W + p];
    free(probe);
    free(size);
    free(T);
}

static void scene_close(struct scene *s)
{
    free(s->means);
    free(s->scales);
    free(s->quats);
    free(s->opacities);
    free(s->bg);
    free(s->color);
    free(s->probe);
}

static double *splat_grab(size_t n)
{
    double *p = calloc(n + 1, sizeof *p);

    if (!p) {
        fprintf(stderr, "golden: out of memory\n");
        exit(1);
    }
    return p;
}

static const char *splat_key(const char *mode, const char *name)
{
    static char text[80];

    snprintf(text, sizeof text, "%s.%s", mode, name);
    return text;
}

/* What a case does not store (quaternions of length 0 have no derivative)
 * cannot be compared. */
static void compare_if(struct golden *g, const char *name, const double *x,
                       size_t n, double tol)
{
    char err[96];

    snprintf(err, sizeof err, "%s.err", name);
    if (golden_has(g, err))
        golden_compare_f64(g, name, x, n, tol);
}

/* (3,4) gradient of our column-form camera as the base code's T. */
static void to_row_vector(double out[12], const double rt[12])
{
    for (int r = 0; r < 3; r++) {
        for (int k = 0; k < 3; k++)
            out[4 * k + r] = (r < 2 ? -1 : 1) * rt[4 * r + k];
        out[4 * r + 3] = (r < 2 ? -1 : 1) * rt[4 * r + 3];
    }
}

static void compare_projection(struct golden *g, const struct reference *t,
                               size_t N)
{
    double *xy = splat_grab(2 * N), *conic = splat_grab(3 * N),
           *z = splat_grab(N);
    double *cov3 = splat_grab(6 * N), *comp = splat_grab(N), wrong = 0;
    double *front = golden_f64(g, "proj.in_front", NULL);

    for (size_t i = 0; i < N; i++) {
        struct reference_point p;

        reference_project(&p, t, i);
        wrong += p.front != (front[i] != 0);
        memcpy(cov3 + 6 * i, p.cov3, sizeof p.cov3);
        if (!p.front)
            continue;
        xy[2 * i] = p.x;
        xy[2 * i + 1] = p.y;
        z[i] = p.z;
        memcpy(conic + 3 * i, p.conic, sizeof p.conic);
        comp[i] = sqrt(fmax(p.det_sharp / p.det, 2.5e-5));
    }
    golden_check(g, "proj.in_front", wrong, wrong, 0);
    golden_compare_f64(g, "proj.means2d", xy, 2 * N, 1e-9);
    golden_compare_f64(g, "proj.conics", conic, 3 * N, 1e-9);
    golden_compare_f64(g, "proj.depths", z, N, 1e-9);
    golden_compare_f64(g, "proj.cov3d", cov3, 6 * N, 1e-9);
    golden_compare_f64(g, "proj.compensation", comp, N, 1e-9);
    free(xy);
    free(conic);
    free(z);
    free(cov3);
    free(comp);
    free(front);
}

/* (H,W,C) to planes. */
static void splat_planes(double *out, const double *in, const struct scene *s)
{
    for (size_t c = 0; c < s->C; c++)
        for (size_t p = 0; p < s->H * s->W; p++)
            out[c * s->H * s->W + p] = in[p * s->C + c];
}

/* Tolerance of gradients, relative to the largest
 * (tests/golden/data/README.md). */
static double gradient_tolerance(const struct golden *g, const char *mode)
{
    if (!strcmp(mode, "dgr"))
        return 1e-6;
    return strstr(g->name, "huge") || strstr(g->name, "needle") ? 1e-7 : 1e-9;
}

static void reference_gradients(struct golden *g, const struct scene *s,
                                const struct reference *t, const char *mode)
{
    size_t N = s->N, C = s->C, P = s->W * s->H;
    struct reference_gradients d = {
        .mean = splat_grab(3 * N), .scale = splat_grab(3 * N),
        .quat = splat_grab(4 * N), .opacity = splat_grab(N),
        .color = splat_grab(C * N), .rt = splat_grab(12),
        .center = splat_grab(2 * N), .conic = splat_grab(3 * N)
    };
    double *probe = splat_grab(P * C), T[12], tol = gradient_tolerance(g, mode);
    struct error err = {0};

    for (size_t i = 0; i < P * C; i++)
        probe[i] = s->probe[i];
    if (reference_backward(&d, t, probe, NULL, &err))
        golden_check(g, err.text, INFINITY, INFINITY, 0);
    compare_if(g, splat_key(mode, "grad.means"), d.mean, 3 * N, tol);
    compare_if(g, splat_key(mode, "grad.scales"), d.scale, 3 * N, tol);
    compare_if(g, splat_key(mode, "grad.quats"), d.quat, 4 * N, tol);
    compare_if(g, splat_key(mode, "grad.opacities"), d.opacity, N, tol);
    compare_if(g, splat_key(mode, "grad.colors"), d.color, C * N, tol);
    to_row_vector(T, d.rt);
    if (t->rules != SPLAT_DGR)
        compare_if(g, splat_key(mode, "grad.T"), T, 12, tol);
    if (t->rules == SPLAT_EXACT) {
        golden_compare_f64(g, "exact.grad2d.means2d", d.center, 2 * N, tol);
        golden_compare_f64(g, "exact.grad2d.conics", d.conic, 3 * N, tol);
    }
    double *all[] = {d.mean, d.scale, d.quat, d.opacity, d.color, d.rt,
                     d.center, d.conic, probe};

    for (size_t k = 0; k < sizeof all / sizeof *all; k++)
        free(all[k]);
}

static void run_reference(struct golden *g, const struct scene *s,
                          const char *mode, enum splat_rules rules)
{
    size_t P = s->W * s->H;
    double *image = splat_grab(P * s->C), *plane = splat_grab(P * s->C);
    double *alpha = splat_grab(P);
    struct reference t;
    struct error err = {0};

    if (!golden_has(g, splat_key(mode, "T.err")) ||
        reference_init(&t, &s->g, &s->cam, (int)s->W, (int)s->H, (int)s->C,
                       rules, 0, &err))
        goto out;
    for (size_t c = 0; c < s->C; c++)
        t.background[c] = s->bg[c];
    if (rules == SPLAT_EXACT)
        compare_projection(g, &t, s->N);
    if (reference_forward(image, alpha, NULL, NULL, &t, &err))
        golden_check(g, err.text, INFINITY, INFINITY, 0);
    splat_planes(plane, image, s);
    for (size_t i = 0; i < P; i++)
        alpha[i] = 1 - alpha[i];
    golden_compare_f64(g, splat_key(mode, "image"), plane, P * s->C, 1e-9);
    golden_compare_f64(g, splat_key(mode, "T"), alpha, P, 1e-9);
    if (golden_has(g, splat_key(mode, "grad.means.err")))
        reference_gradients(g, s, &t, mode);
    reference_release(&t);
out:
    free(image);
    free(plane);
    free(alpha);
}

/* The kernels at their most exact settings. */
static bool kernel_draw(struct splat *r, float *image, float *alpha,
                        const struct scene *s, enum splat_rules rules,
                        struct golden *g)
{
    struct splat_options opt =
        splat_defaults((int)s->W, (int)s->H, (int)s->C);
    struct error err = {0};

    opt.rules = rules;
    opt.exp_degree = 5;
    opt.fixed16 = false;
    opt.gradients = true;
    if (!splat_init(r, &opt, &err) && !splat_load(r, &s->g, &err) &&
        !splat_draw(r,
                    &(struct splat_pictures){.image = image, .alpha = alpha},
                    &s->cam, NULL, s->bg, &err))
        return true;
    golden_check(g, err.text, INFINITY, INFINITY, 0);
    return false;
}

static void compare_l2_if(struct golden *g, const char *name, const float *x,
                          size_t n)
{
    char err[96];

    snprintf(err, sizeof err, "%s.err", name);
    if (golden_has(g, err))
        golden_compare_l2(g, name, x, n);
}

static void kernel_gradients(struct golden *g, struct splat *r,
                             const struct scene *s, const char *mode)
{
    size_t N = s->N, C = s->C;
    float *all = calloc(N * (11 + C) + 12, sizeof *all);
    struct splat_gradients d = {all, all + 3 * N, all + 6 * N, all + 10 * N,
                                all + 11 * N, all + (11 + C) * N, NULL};
    double rt[12], T[12];
    float Tf[12];
    struct error err = {0};

    if (splat_backward(r, &d,
                       &(struct splat_picture_gradients){.image = s->probe},
                       &err))
        golden_check(g, err.text, INFINITY, INFINITY, 0);
    compare_l2_if(g, splat_key(mode, "grad.means"), d.mean, 3 * N);
    compare_l2_if(g, splat_key(mode, "grad.scales"), d.scale, 3 * N);
    compare_l2_if(g, splat_key(mode, "grad.quats"), d.quat, 4 * N);
    compare_l2_if(g, splat_key(mode, "grad.opacities"), d.opacity, N);
    compare_l2_if(g, splat_key(mode, "grad.colors"), d.color, C * N);
    for (int k = 0; k < 12; k++)
        rt[k] = d.rt[k];
    to_row_vector(T, rt);
    for (int k = 0; k < 12; k++)
        Tf[k] = (float)T[k];
    compare_l2_if(g, splat_key(mode, "grad.T"), Tf, 12);
    free(all);
}

/* T comes out as alpha = 1 - T in float: half a unit in its last place, 3e-8,
 * may be lost, which the tolerance of the files (relative to T) forgets. */
static void splat_transmittance(struct golden *g, const char *name,
                                const float *T, const uint8_t *skip,
                                size_t pixels)
{
    char text[96];
    size_t n;
    double worst = 0;

    snprintf(text, sizeof text, "%s.err", name);
    double *err = golden_f64(g, text, NULL);
    double *want = golden_f64(g, name, &n);

    for (size_t p = 0; p < pixels && n == pixels; p++)
        if (!skip[p])
            worst = fmax(worst, fabs(T[p] - want[p]));
    golden_check(g, name, n == pixels ? worst : INFINITY,
                 worst / fmax(err[3], 1e-300), err[5] + 6e-8);
    free(err);
    free(want);
}

static void run_kernels(struct golden *g, const struct scene *s,
                        const char *mode, enum splat_rules rules)
{
    size_t P = s->W * s->H;
    float *image = calloc(P * s->C + 1, sizeof *image);
    float *plane = calloc(P * s->C + 1, sizeof *plane);
    float *T = calloc(P + 1, sizeof *T);
    struct splat r = {0};
    uint8_t *skip = calloc(P + 1, 1);

    if (!golden_has(g, splat_key(mode, "T.err")))
        goto out;
    double *ambiguous = golden_f64(g, splat_key(mode, "ambiguous"), NULL);

    for (size_t p = 0; p < P; p++)
        skip[p] = ambiguous[p] != 0;
    free(ambiguous);
    if (kernel_draw(&r, image, T, s, rules, g)) {
        for (size_t p = 0; p < P; p++) {
            T[p] = 1 - T[p];
            for (size_t c = 0; c < s->C; c++)
                plane[c * P + p] = image[p * s->C + c];
        }
        golden_compare_masked(g, splat_key(mode, "image"), plane, P * s->C,
                              skip, P);
        splat_transmittance(g, splat_key(mode, "T"), T, skip, P);
        if (golden_has(g, splat_key(mode, "grad.means.err")))
            kernel_gradients(g, &r, s, mode);
    }
out:
    splat_release(&r);
    free(image);
    free(plane);
    free(T);
    free(skip);
}

static void run_splat(struct golden *g)
{
    struct scene s;

    scene_open(&s, g);
    run_reference(g, &s, "exact", SPLAT_EXACT);
    run_reference(g, &s, "gsplat", SPLAT_GSPLAT);
    run_reference(g, &s, "dgr", SPLAT_DGR);
    run_kernels(g, &s, "gsplat", SPLAT_GSPLAT);
    run_kernels(g, &s, "dgr", SPLAT_DGR);
    scene_close(&s);
}

GOLDEN_CASE("07_splat", run_splat)
