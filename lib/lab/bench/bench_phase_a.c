/* Phase A's networks in the paper's configuration (ViT-B/14 at 518, fusion
 * head, Phi_init, the three decoders), untrained weights, in every precision.
 * What is between them (coverage, sampling, features of vertices) is not
 * timed here: `spid-branches --stats` tells it for a model. */
#include "lib/lab/bench/bench.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/net/config.h"
#include "lib/base/parallel.h"
#include "lib/base/random.h"
#include "lib/net/backbone.h"
#include "lib/net/conv_decoder.h"
#include "lib/net/mlp_decoder.h"
#include "lib/net/plane_init.h"

#define POINTS 20018             /* V + |E| of FLAME */

struct phase_a {
    struct avatar_config config;
    struct params ps;
    struct backbone backbone;
    struct plane_init init;
    struct conv_decoder plane, mouth;
    struct mlp_decoder dynamic;
    size_t cells, sheet;         /* n^2, K^2 */
    float *rgb;                  /* (S,S,3) */
    float *features;             /* (n,n,C_f) */
    float *covered;              /* (n,n,C_f+1): features and C */
    float *delta;                /* (n,n,2) */
    float *points;               /* (POINTS,vertex+C_f) */
    struct gaussian_out out[3];  /* plane, dynamic, mouth */
};

/* Every network once, what is between them replaced by copies. */
static int phase_a_call(void *context, struct error *err)
{
    static const float dir[3] = {0, 0, 1};
    struct phase_a *a = context;
    const size_t C = a->config.feature, V = a->config.vertex_width;

    (void)err;
    backbone_forward(a->features, a->rgb, &a->backbone);
    for (size_t i = 0; i < a->cells; i++)
        memcpy(a->covered + i * (C + 1), a->features + i * C,
               C * sizeof *a->features);
    plane_init_forward(a->delta, a->covered, &a->init);
    conv_decoder_forward(&a->out[0], a->features, dir, NULL, &a->plane);
    for (size_t i = 0; i < POINTS; i++)
        memcpy(a->points + i * (V + C) + V, a->features + i * C,
               C * sizeof *a->features);
    mlp_decoder_forward(&a->out[1], a->points, dir, NULL, &a->dynamic);
    conv_decoder_forward(&a->out[2], a->features, dir, NULL, &a->mouth);
    return 0;
}

/* n zeros. */
static float *phase_a_floats(size_t n)
{
    return calloc(n, sizeof(float));
}

/* Inputs in noise, outputs in zeros. */
static int phase_a_allocate(struct phase_a *a, struct error *err)
{
    const struct avatar_config *c = &a->config;
    const size_t counts[3] = {a->cells, POINTS, a->sheet};
    const size_t S = 3 * c->size * c->size;
    struct random r;
    bool ok = true;

    a->rgb = phase_a_floats(S);
    a->features = phase_a_floats(a->cells * c->feature);
    a->covered = phase_a_floats(a->cells * (c->feature + 1));
    a->delta = phase_a_floats(a->cells * 2);
    a->points = phase_a_floats(POINTS * (c->vertex_width + c->feature));
    for (int i = 0; i < 3; i++) {
        a->out[i] = (struct gaussian_out){
            phase_a_floats(counts[i] * c->channels), phase_a_floats(counts[i]),
            phase_a_floats(counts[i] * 3), phase_a_floats(counts[i] * 4),
            phase_a_floats(counts[i] * 3)};
        ok = ok && a->out[i].color && a->out[i].opacity && a->out[i].scale
            && a->out[i].quat && a->out[i].position;
    }
    if (!ok || !a->rgb || !a->features || !a->covered || !a->delta
        || !a->points)
        return error_set(err, EX_OSERR, "no memory for Phase A's bench");
    random_init(&r, 7, "bench phase a");
    for (size_t i = 0; i < S; i++)
        a->rgb[i] = (float)random_uniform(&r);
    for (size_t i = 0; i < POINTS; i++)
        for (size_t k = 0; k < c->vertex_width; k++)
            a->points[i * (c->vertex_width + c->feature) + k] =
                (float)random_range(&r, -1, 1);
    return 0;
}

/* The networks, in random weights. */
static int phase_a_declare(struct phase_a *a, struct error *err)
{
    const struct avatar_config *c = &a->config;
    const struct gaussian_head heads[3] = {
        {.colors = c->channels, .position = GAUSSIAN_POSITION_DEPTH},
        {.colors = c->channels, .position = GAUSSIAN_POSITION_NONE},
        {.colors = c->channels, .position = GAUSSIAN_POSITION_OFFSET}
    };

    params_init(&a->ps);
    if (backbone_init(&a->backbone, &a->ps, "backbone.", &c->backbone, err)
        || plane_init_init(&a->init, &a->ps, "init.", c->feature + 1,
                           c->init_width, err)
        || conv_decoder_init(&a->plane, &a->ps, "static.", c->feature,
                             c->static_width, heads[0], err)
        || mlp_decoder_init(&a->dynamic, &a->ps, "dynamic.",
                            c->vertex_width + c->feature, c->dynamic_width,
                            c->dynamic_hidden, heads[1], err)
        || conv_decoder_init(&a->mouth, &a->ps, "mouth.", c->feature,
                             c->mouth_width, heads[2], err)
        || params_allocate(&a->ps, err))
        return -1;
    params_randomise(&a->ps, 1);
    return 0;
}

/* For one picture in a precision. */
static int phase_a_plan(struct phase_a *a, enum nn_type type,
                        struct error *err)
{
    const struct nn_options opt = {NN_INFER, type};
    const size_t n = a->config.plane, K = a->config.mouth;

    return backbone_plan(&a->backbone, 1, a->config.size, opt, err)
        || plane_init_plan(&a->init, 1, n, n, opt, err)
        || conv_decoder_plan(&a->plane, 1, n, n, opt, err)
        || mlp_decoder_plan(&a->dynamic, 1, POINTS, opt, err)
        || conv_decoder_plan(&a->mouth, 1, K, K, opt, err) ? -1 : 0;
}

/* All of it. */
static void phase_a_release(struct phase_a *a)
{
    backbone_release(&a->backbone);
    plane_init_release(&a->init);
    conv_decoder_release(&a->plane);
    mlp_decoder_release(&a->dynamic);
    conv_decoder_release(&a->mouth);
    params_release(&a->ps);
    for (int i = 0; i < 3; i++) {
        free(a->out[i].color);
        free(a->out[i].opacity);
        free(a->out[i].scale);
        free(a->out[i].quat);
        free(a->out[i].position);
    }
    free(a->rgb);
    free(a->features);
    free(a->covered);
    free(a->delta);
    free(a->points);
}

/* One row; errors are of the static plane's RGB, whose peak is 1. */
static int phase_a_bench(struct bench *b, struct phase_a *a, double *truth,
                         enum nn_type type, struct error *err)
{
    const size_t n = a->cells, C = a->config.channels;
    double max = NAN, psnr = NAN;
    float *rgb = phase_a_floats(3 * n);
    struct bench_times t;
    int rc = -1;

    if (!rgb)
        return error_set(err, EX_OSERR, "no memory for Phase A's bench");
    if (phase_a_plan(a, type, err) == 0 &&
        bench_time(&t, b->seconds / 6, 2, phase_a_call, a, err) == 0) {
        for (size_t i = 0; i < 3 * n; i++) {
            rgb[i] = a->out[0].color[i / 3 * C + i % 3];
            truth[i] = type == NN_F32 ? (double)rgb[i] : truth[i];
        }
        if (type != NN_F32)
            bench_compare(&max, &psnr, rgb, truth, 3 * n);
        if (bench_add(b, "shape", "Phase A, ViT-B/14 at 518, n=296",
                      nn_type_name(type), b->threads, &t, max, psnr))
            rc = 0;
    }
    free(rgb);
    return rc;
}

int bench_phase_a(struct bench *b, struct error *err)
{
    static const enum nn_type types[] = {NN_F32, NN_FAST, NN_BF16};
    const int before = parallel_width();
    struct phase_a a = {0};
    double *truth = NULL;
    int rc = -1;

    parallel_set_width(b->threads);
    avatar_config_paper(&a.config);
    a.cells = a.config.plane * a.config.plane;
    a.sheet = a.config.mouth * a.config.mouth;
    truth = calloc(3 * a.cells, sizeof *truth);
    if (!truth)
        error_set(err, EX_OSERR, "no memory for Phase A's bench");
    else if (phase_a_allocate(&a, err) == 0 && phase_a_declare(&a, err) == 0)
        rc = 0;
    for (int i = 0; i < 3 && rc == 0; i++)
        rc = phase_a_bench(b, &a, truth, types[i], err);
    parallel_set_width(before);
    phase_a_release(&a);
    free(truth);
    return rc;
}
