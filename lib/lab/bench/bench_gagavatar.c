/* GAGAvatar at its full size (random weights) beside SpiD: Phase A once, then
 * a frame: 180,255 Gaussians in 32 channels by the public rasteriser's rules,
 * and StyleUNet at 512.  Errors are of the picture's features against the same
 * without 16-bit products, and of the refiner against f32. */
#include "lib/lab/bench/bench.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"
#include "lib/base/random.h"
#include "lib/net/gagavatar.h"
#include "lib/base/camera.h"
#include "lib/splat/splat.h"

#define VERTICES 5023           /* FLAME's */
#define SPACING 0.6f            /* standard deviation over the distance of a
                                 * plane's points */

struct gagavatar_bench {
    struct avatar_config config;
    struct params ps, refiner_ps;
    struct gagavatar net;
    struct refiner refiner;
    struct splat splat;
    struct splat_camera view;
    float cam[12];
    float *rgb, *verts, *feat, *out;    /* (S,S,3) (V,3) (S,S,C) (S,S,3) */
};

/* Phase A. */
static int gagavatar_bench_bake(void *context, struct error *err)
{
    struct gagavatar_bench *g = context;

    (void)err;
    gagavatar_bake(&g->net, g->rgb, g->cam, g->verts);
    return 0;
}

static int gagavatar_bench_draw(void *context, struct error *err)
{
    struct gagavatar_bench *g = context;

    return splat_update(&g->splat, g->verts, 0, VERTICES, err) ||
           splat_forward(&g->splat, g->feat, NULL, NULL, &g->view, NULL, err);
}

static int gagavatar_bench_refine(void *context, struct error *err)
{
    struct gagavatar_bench *g = context;

    (void)err;
    refiner_forward(g->out, g->feat, &g->refiner);
    return 0;
}

/* Random weights give no picture of a head: opaque Gaussians as large as the
 * planes' spacing stand in for a trained model's. */
static void gagavatar_bench_make_opaque(struct gagavatar_bench *g)
{
    const float s = SPACING * 2 / (float)g->config.plane;

    for (size_t i = 0; i < g->net.set.n; i++) {
        g->net.opacity[i] = 0.9f;
        for (int k = 0; k < 3; k++)
            g->net.scale[3 * i + (size_t)k] = s;
    }
    gagavatar_unit_rotations(g->net.scale, g->net.quat, g->net.set.n);
}

/* Its configuration with random weights, and buffers for one frame. */
static int gagavatar_bench_open(struct gagavatar_bench *g, enum nn_type type,
                                struct error *err)
{
    const size_t S = 512, C = 32;
    struct random r;

    avatar_config_gagavatar(&g->config);
    g->rgb = calloc(3 * S * S, sizeof *g->rgb);
    g->out = calloc(3 * S * S, sizeof *g->out);
    g->feat = calloc(C * S * S, sizeof *g->feat);
    g->verts = calloc(3 * VERTICES, sizeof *g->verts);
    if (!g->rgb || !g->out || !g->feat || !g->verts)
        return error_set(err, EX_OSERR, "no memory for GAGAvatar's bench");
    random_init(&r, 3, "bench gagavatar");
    for (size_t i = 0; i < 3 * S * S; i++)
        g->rgb[i] = (float)random_uniform(&r);
    for (size_t i = 0; i < 3 * VERTICES; i++)
        g->verts[i] = (float)random_range(&r, -0.5, 0.5);
    camera_frontal(g->cam, 12);
    g->view = splat_camera_square(g->cam, (int)S, CAMERA_FOCAL);
    params_init(&g->ps);
    params_init(&g->refiner_ps);
    if (gagavatar_init(&g->net, &g->ps, &g->config, VERTICES, err) ||
        params_allocate(&g->ps, err))
        return -1;
    params_randomise(&g->ps, 1);
    return gagavatar_plan(&g->net, type, err);
}

static void gagavatar_bench_close(struct gagavatar_bench *g)
{
    gagavatar_release(&g->net);
    refiner_release(&g->refiner);
    splat_release(&g->splat);
    params_release(&g->ps);
    params_release(&g->refiner_ps);
    free(g->rgb);
    free(g->out);
    free(g->feat);
    free(g->verts);
}

/* The features with and without 16-bit products. */
static int gagavatar_bench_splat(double *ms, struct bench *b,
                                 struct gagavatar_bench *g, struct error *err)
{
    const size_t n = 512 * 512 * 32;
    struct splat_options o = splat_defaults(512, 512, 32);
    double *truth = calloc(n, sizeof *truth), most = NAN, psnr = NAN;
    struct bench_times t;
    int rc = truth ? 0 : error_set(err, EX_OSERR, "no memory for features");

    for (int exact = 1; exact >= 0 && rc == 0; exact--) {
        o.rules = SPLAT_DGR;
        o.fixed16 = o.fixed16 && !exact;
        o.threads = b->threads;
        splat_release(&g->splat);
        memset(&g->splat, 0, sizeof g->splat);
        rc = splat_init(&g->splat, &o, err) ||
                     splat_load(&g->splat, &g->net.set, err) ||
                     bench_time(&t, b->seconds / 8, 3, gagavatar_bench_draw,
                                g, err)
                 ? -1
                 : 0;
        o = splat_defaults(512, 512, 32);
        for (size_t i = 0; exact && i < n; i++)
            truth[i] = g->feat[i];
        if (!exact)
            bench_compare(&most, &psnr, g->feat, truth, n);
        if (rc == 0 && !bench_add(b, "gagavatar", "512x512 N=180255 C=32 dgr",
                                  exact ? "float" : "default", b->threads, &t,
                                  exact ? NAN : most, exact ? NAN : psnr))
            rc = -1;
    }
    *ms = t.median;
    free(truth);
    return rc;
}

/* StyleUNet on what was drawn. */
static int gagavatar_bench_unet(double *ms, struct bench *b,
                                struct gagavatar_bench *g, struct error *err)
{
    const struct nn_options opt = {NN_INFER, NN_FAST};
    struct bench_times t;

    if (gagavatar_init_refiner(&g->refiner, &g->refiner_ps, &g->config, err) ||
        params_allocate(&g->refiner_ps, err))
        return -1;
    params_randomise(&g->refiner_ps, 1);
    if (refiner_plan(&g->refiner, 1, 512, 512, opt, err) ||
        bench_time(&t, b->seconds / 4, 2, gagavatar_bench_refine, g, err) ||
        !bench_add(b, "gagavatar", "StyleUNet 512", "fast", b->threads, &t,
                   NAN, NAN))
        return -1;
    *ms = t.median;
    return 0;
}

int bench_gagavatar(struct bench *b, struct error *err)
{
    const int before = parallel_width();
    struct gagavatar_bench g = {0};
    struct bench_times bake;
    double draw = 0, refine = 0;
    int rc = -1;

    parallel_set_width(b->threads);
    if (gagavatar_bench_open(&g, NN_FAST, err) == 0 &&
        bench_time(&bake, b->seconds / 4, 2, gagavatar_bench_bake, &g,
                   err) == 0 &&
        bench_add(b, "gagavatar", "Phase A, ViT-B/14 at 518, 2 planes of 296",
                  "fast", b->threads, &bake, NAN, NAN)) {
        gagavatar_bench_make_opaque(&g);
        rc = gagavatar_bench_splat(&draw, b, &g, err) ||
                     gagavatar_bench_unet(&refine, b, &g, err)
                 ? -1
                 : 0;
    }
    if (rc == 0) {
        bench_number(b, "fps", "gagavatar", 1e3 / (draw + refine));
        bench_note(b, "gagavatar: %.2f frames a second here (splat %.1f ms, "
                   "StyleUNet %.0f ms; head and tracking apart); SpiD here: "
                   "stage pipeline; the paper's SpiD on an A100: 43, SpiD* "
                   "154", 1e3 / (draw + refine), draw, refine);
    }
    gagavatar_bench_close(&g);
    parallel_set_width(before);
    return rc;
}
