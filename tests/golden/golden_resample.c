/* Case 10: grid sampling, affine grids and resizing, forward and backward. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/resample.h"
#include "lib/nn/rescale.h"
#include "tests/golden/golden.h"

/* [B,C,n] to [B,n,C], or back when to_planes. */
static float *resample_rotated(const float *x, size_t B, size_t C, size_t n,
                              bool to_planes)
{
    float *y = malloc(B * C * n * sizeof *y);

    for (size_t b = 0; b < B; b++)
        for (size_t c = 0; c < C; c++)
            for (size_t i = 0; i < n; i++) {
                size_t p = (b * C + c) * n + i, q = (b * n + i) * C + c;

                if (to_planes)
                    y[p] = x[q];
                else
                    y[q] = x[p];
            }
    return y;
}

/* The stored input, or the formula's. */
static float *resample_input(struct golden *g, const char *name, size_t n,
                             double bound)
{
    char full[80];

    if (golden_has(g, name))
        return golden_f32(g, name, NULL);
    snprintf(full, sizeof full, "input.%s", name);
    return golden_array(full, g->seed, n, 0, bound);
}

static void compare_planes(struct golden *g, const char *name,
                           const float *x, size_t B, size_t C, size_t n)
{
    float *y = resample_rotated(x, B, C, n, true);

    golden_compare(g, name, y, B * C * n);
    free(y);
}

static void resample_numbers(size_t *out, size_t n, const cJSON *list)
{
    for (size_t i = 0; i < n; i++)
        out[i] = (size_t)cJSON_GetArrayItem(list, (int)i)->valuedouble;
}

/* ---- grid sampling ---------------------------------------------------- */

struct sampling {
    const char *name;          /* "gs.ac0.zeros" */
    size_t B, C, H, W, N;
    bool align;
    enum resample_padding pad;
    const float *x, *grid;     /* x in planes */
};

static void run_sampling(struct golden *g, const struct sampling *s)
{
    const size_t in = s->H * s->W;
    float *x = resample_rotated(s->x, s->B, s->C, in, false);
    float *out = malloc(s->B * s->N * s->C * sizeof *out);
    float *gx = calloc(s->B * in * s->C, sizeof *gx);
    float *ggrid = calloc(s->B * s->N * 2, sizeof *ggrid);
    float *probe = golden_probe_array(g->seed, s->B * s->C * s->N);
    float *gout = resample_rotated(probe, s->B, s->C, s->N, false);
    char name[80];

    grid_sample(out, x, s->grid, s->B, s->H, s->W, s->C, s->N, s->align,
                s->pad);
    snprintf(name, sizeof name, "%s.out", s->name);
    compare_planes(g, name, out, s->B, s->C, s->N);
    grid_sample_backward(gx, ggrid, gout, x, s->grid, s->B, s->H, s->W, s->C,
                         s->N, s->align, s->pad);
    snprintf(name, sizeof name, "%s.grad_x", s->name);
    compare_planes(g, name, gx, s->B, s->C, in);
    snprintf(name, sizeof name, "%s.grad_grid", s->name);
    golden_compare(g, name, ggrid, s->B * s->N * 2);
    free(x);
    free(out);
    free(gx);
    free(ggrid);
    free(probe);
    free(gout);
}

static void run_edge(struct golden *g, const struct sampling *s)
{
    size_t count;
    float *grid = golden_f32(g, "gs.edge_grid", &count);
    float *x = resample_rotated(s->x, s->B, s->C, s->H * s->W, false);
    size_t N = count / 2 / s->B;
    float *out = malloc(s->B * N * s->C * sizeof *out);
    char name[80];

    grid_sample(out, x, grid, s->B, s->H, s->W, s->C, N, s->align, s->pad);
    snprintf(name, sizeof name, "%s.edge_out", s->name);
    compare_planes(g, name, out, s->B, s->C, N);
    free(grid);
    free(x);
    free(out);
}

static void run_grids(struct golden *g, const cJSON *ops)
{
    size_t d[6], p[4];
    float *x, *grid, *px, *pgrid;

    resample_numbers(d, 6, cJSON_GetObjectItem(ops, "gs"));
    resample_numbers(p, 4, cJSON_GetObjectItem(ops, "pt"));
    x = resample_input(g, "gs.x", d[0] * d[1] * d[2] * d[3], 1);
    grid = resample_input(g, "gs.grid", d[0] * d[4] * d[5] * 2, 1.3);
    px = resample_input(g, "pt.x", p[0] * p[1] * p[2], 1);
    pgrid = resample_input(g, "pt.grid", p[3] * 2, 1.05);
    for (int k = 0; k < 4; k++) {
        char name[32];
        struct sampling s = {
            name, d[0], d[1], d[2], d[3], d[4] * d[5], k & 1,
            k & 2 ? RESAMPLE_BORDER : RESAMPLE_ZEROS, x, grid
        };

        snprintf(name, sizeof name, "gs.ac%d.%s", k & 1,
                 k & 2 ? "border" : "zeros");
        run_sampling(g, &s);
        run_edge(g, &s);
    }
    for (int k = 0; k < 2; k++) {
        struct sampling s = {
            k ? "pt.ac1.border" : "pt.ac0.zeros", 1, p[0], p[1], p[2], p[3],
            k, k ? RESAMPLE_BORDER : RESAMPLE_ZEROS, px, pgrid
        };

        run_sampling(g, &s);
    }
    free(x);
    free(grid);
    free(px);
    free(pgrid);
}

static void run_affine(struct golden *g, const cJSON *ops)
{
    size_t d[6];
    float *theta = golden_f32(g, "affine.theta", NULL);

    resample_numbers(d, 6, cJSON_GetObjectItem(ops, "gs"));
    for (int k = 0; k < 2; k++) {
        size_t n = d[0] * d[4] * d[5] * 2;
        float *grid = malloc(n * sizeof *grid);
        float *gtheta = calloc(d[0] * 6, sizeof *gtheta);
        float *probe = golden_probe_array(g->seed, n);

        affine_grid(grid, theta, d[0], d[4], d[5], k);
        golden_compare(g, k ? "affine.ac1.out" : "affine.ac0.out", grid, n);
        affine_grid_backward(gtheta, probe, d[0], d[4], d[5], k);
        golden_compare(g, k ? "affine.ac1.grad_theta"
                            : "affine.ac0.grad_theta", gtheta, d[0] * 6);
        free(grid);
        free(gtheta);
        free(probe);
    }
    free(theta);
}

/* ---- resizing --------------------------------------------------------- */

struct resizing {
    char name[80];             /* "it.bicubic.ac0.29x31" */
    enum rescale_mode mode;
    size_t B, C, H, W, h, w;
    double fy, fx;
    const float *x;            /* planes */
};

static void run_resizing(struct golden *g, const struct resizing *s)
{
    const size_t in = s->H * s->W, out = s->h * s->w;
    struct nn_plan plan;
    struct rescale r;
    struct error err;
    float *x = resample_rotated(s->x, s->B, s->C, in, false);
    float *y = malloc(s->B * s->C * out * sizeof *y);
    float *gx = calloc(s->B * s->C * in, sizeof *gx);
    float *probe = golden_probe_array(g->seed, s->B * s->C * out);
    float *gout = resample_rotated(probe, s->B, s->C, out, false);
    char name[96];

    nn_plan_init(&plan, (struct nn_options){NN_FROZEN, NN_F32});
    if (s->fy > 0)
        rescale_plan_factor(&r, &plan, s->mode, s->B, s->H, s->W, s->h, s->w,
                            s->fy, s->fx, s->C);
    else
        rescale_plan(&r, &plan, s->mode, s->B, s->H, s->W, s->h, s->w, s->C);
    if (nn_plan_finish(&plan, &err)) {
        fprintf(stderr, "golden: %s\n", err.text);
        exit(1);
    }
    rescale_forward(y, x, &r);
    snprintf(name, sizeof name, "%s.out", s->name);
    compare_planes(g, name, y, s->B, s->C, out);
    rescale_backward(gx, gout, &r);
    snprintf(name, sizeof name, "%s.grad_x", s->name);
    compare_planes(g, name, gx, s->B, s->C, in);
    nn_plan_release(&plan);
    free(x);
    free(y);
    free(gx);
    free(probe);
    free(gout);
}

static void run_sizes(struct golden *g, const cJSON *ops)
{
    static const struct {
        const char *name;
        enum rescale_mode mode;
    } kinds[] = {
        {"bilinear.ac0", RESCALE_BILINEAR}, {"bilinear.ac1", RESCALE_ALIGNED},
        {"bilinear.aa", RESCALE_ANTIALIAS}, {"bicubic.ac0", RESCALE_BICUBIC},
    };
    const cJSON *size;
    size_t d[4];
    float *x;

    resample_numbers(d, 4, cJSON_GetObjectItem(ops, "it"));
    x = resample_input(g, "it.x", d[0] * d[1] * d[2] * d[3], 1);
    cJSON_ArrayForEach(size, cJSON_GetObjectItem(ops, "sizes")) {
        size_t m[2];

        resample_numbers(m, 2, size);
        for (size_t k = 0; k < 4; k++) {
            struct resizing s = {
                "", kinds[k].mode, d[0], d[1], d[2], d[3], m[0], m[1], 0, 0, x
            };

            snprintf(s.name, sizeof s.name, "it.%s.%zux%zu", kinds[k].name,
                     m[0], m[1]);
            run_resizing(g, &s);
        }
    }
    for (int k = 0; k < 3; k++) {
        const double f = k < 2 ? 2 : 0.5;
        struct resizing s = {
            "", k == 1 ? RESCALE_ALIGNED : RESCALE_BILINEAR, d[0], d[1], d[2],
            d[3], (size_t)((double)d[2] * f), (size_t)((double)d[3] * f), f,
            f, x
        };

        snprintf(s.name, sizeof s.name, "it.scale%s.bilinear.ac%d",
                 k < 2 ? "2" : "0p5", k == 1);
        run_resizing(g, &s);
    }
    free(x);
}

static void run_positions(struct golden *g, const cJSON *ops)
{
    const cJSON *size;
    size_t d[2];
    float *x, *planes;

    resample_numbers(d, 2, cJSON_GetObjectItem(ops, "pe"));
    x = golden_array("input.pe.x", g->seed, d[0] * d[0] * d[1], 0, 0.5);
    planes = x;
    cJSON_ArrayForEach(size, cJSON_GetObjectItem(ops, "pesz")) {
        struct resizing s = {
            "", RESCALE_BICUBIC, 1, d[1], d[0], d[0], 0, 0, 0, 0, planes
        };
        size_t m[2];

        resample_numbers(m, 2, size);
        s.h = m[0];
        s.w = m[1];
        s.fy = ((double)m[0] + 0.1) / (double)d[0];
        s.fx = ((double)m[1] + 0.1) / (double)d[0];
        snprintf(s.name, sizeof s.name, "pe.%zux%zu", m[0], m[1]);
        run_resizing(g, &s);
    }
    free(x);
}

static void run_images(struct golden *g, const cJSON *ops)
{
    const cJSON *size;
    size_t d[4];
    float *x;

    resample_numbers(d, 4, cJSON_GetObjectItem(ops, "im"));
    x = golden_image("input.image", g->seed, d[0] * d[1], d[2], d[3], false);
    cJSON_ArrayForEach(size, cJSON_GetObjectItem(ops, "imsz")) {
        struct resizing s = {
            "", RESCALE_ANTIALIAS, d[0], d[1], d[2], d[3], 0, 0, 0, 0, x
        };
        size_t m[2];

        resample_numbers(m, 2, size);
        s.h = m[0];
        s.w = m[1];
        snprintf(s.name, sizeof s.name, "im.tvresize.%zux%zu", m[0], m[1]);
        run_resizing(g, &s);
    }
    free(x);
}

static void run_resample(struct golden *g)
{
    cJSON *ops = golden_json(g, "ops");

    run_grids(g, ops);
    run_affine(g, ops);
    run_sizes(g, ops);
    run_positions(g, ops);
    run_images(g, ops);
    cJSON_Delete(ops);
}

GOLDEN_CASE("10_resample", run_resample)
