/* Phase B's first half: the face crop, the motion encoder with its six heads,
 * and what their numbers mean; and E_beta of Phase A. */
#include "lib/lab/bench/bench.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/arena.h"
#include "lib/base/parallel.h"
#include "lib/base/random.h"
#include "lib/base/crop.h"
#include "lib/net/motion_encoder.h"
#include "lib/net/shape_encoder.h"
#include "lib/track/encoders.h"
#include "lib/track/track.h"

/* ---- the face crop ---------------------------------------------------- */

#define SIDE 512                 /* of the picture the crop is cut from */

struct crop_case {
    uint8_t *rgb;                /* (SIDE,SIDE,3) */
    float *out;                  /* (224,224,3) */
    struct square q;
};

/* Cut the face crop. */
static int bench_call_crop(void *context, struct error *err)
{
    struct crop_case *c = context;

    (void)err;
    crop_sample_u8(c->out, CROP_NET, c->rgb, SIDE, SIDE, 3 * SIDE, c->q);
    return 0;
}

/* The crop's row, against double. */
static int bench_crop(struct bench *b, struct error *err)
{
    const size_t n = 3 * SIDE * SIDE, m = 3 * CROP_NET * CROP_NET;
    struct arena a = {0};
    struct crop_case c = {arena_take(&a, n, 1),
                          arena_take(&a, m, sizeof *c.out),
                          {250.3, 270.7, 287.4}};
    double *exact = arena_take(&a, n, sizeof *exact);
    double *truth = arena_take(&a, m, sizeof *truth), max, psnr;
    struct bench_times t;
    struct random r;
    int rc = -1;

    if (arena_check(&a, "the crop's bench", err))
        goto out;
    random_init(&r, 1, "bench crop");
    for (size_t i = 0; i < n; i++)
        exact[i] = (c.rgb[i] = (uint8_t)random_below(&r, 256)) / 255.0;
    crop_sample_ref(truth, CROP_NET, exact, SIDE, SIDE, c.q);
    if (bench_time(&t, b->seconds / 20, 50, bench_call_crop, &c, err) != 0)
        goto out;
    bench_compare(&max, &psnr, c.out, truth, m);
    if (!bench_add(b, "crop", "287x287 -> 224x224 u8 -> f32", "default", 1,
                   &t, max, psnr))
        goto out;
    bench_number(b, "ms", "crop", t.median);
    rc = 0;
out:
    arena_release(&a);
    return rc;
}

/* ---- the encoders ----------------------------------------------------- */

struct net_case {
    struct model model;
    struct encoders e;
    bool shape;                  /* E_beta, not E_m */
    float *in, *out;
    size_t count;                /* numbers that come out */
};

/* One encoder on one crop. */
static int bench_call_net(void *context, struct error *err)
{
    struct net_case *c = context;

    (void)err;
    if (c->shape)
        shape_encoder_forward(c->out, c->in, &c->e.shape);
    else
        motion_encoder_forward(c->out, c->in, &c->e.motion);
    return 0;
}

/* One row: type and threads; the first call's output is the truth of the
 * others. */
static int bench_net(struct bench *b, struct net_case *c, double *truth,
                     enum nn_type type, int threads, struct error *err)
{
    const char *stage = c->shape ? "shape" : "motion";
    char config[96];
    double max = NAN, psnr = NAN;
    struct bench_times t;
    int rc;

    parallel_set_width(threads);
    if (encoders_open(&c->e, &c->model, c->shape, type, err))
        return -1;
    rc = motion_encoder_plan(&c->e.motion, 1, c->e.motion.plan.opt, err) ||
         bench_time(&t, b->seconds / 6, 20, bench_call_net, c, err) ? -1 : 0;
    if (type == NN_F32 && threads == 1) {
        max = 0;                /* the truth itself */
        psnr = INFINITY;
        for (size_t i = 0; i < c->count; i++)
            truth[i] = c->out[i];
    } else {
        bench_compare(&max, &psnr, c->out, truth, c->count);
    }
    snprintf(config, sizeof config, "%s 224x224 model",
             c->shape ? c->model.config.shape_net : c->model.config.motion_net);
    if (rc == 0 && !bench_add(b, stage, config, nn_type_name(type), threads,
                              &t, max, psnr))
        rc = -1;
    if (rc == 0 && !c->shape && type == NN_F32 && threads == b->threads)
        bench_number(b, "ms", "motion", t.median);
    encoders_release(&c->e);
    return rc;
}

/* One encoder in every precision, on one thread and all. */
static int bench_nets(struct bench *b, bool shape, struct error *err)
{
    static const enum nn_type types[] = {NN_F32, NN_FAST, NN_BF16};
    const size_t m = 3 * CROP_NET * CROP_NET;
    struct net_case c = {.shape = shape, .count = shape ? SHAPE_ENCODER_OUT
                                                        : MOTION_OUT};
    double truth[SHAPE_ENCODER_OUT];
    const int before = parallel_width();
    struct random r;
    int rc = -1;

    if (!b->model)
        return error_set(err, EX_NOINPUT, "no model.safetensors (expected -m "
                         "MODEL)");
    if (model_open(&c.model, b->model, err))
        return -1;
    c.in = malloc(m * sizeof *c.in);
    c.out = malloc(SHAPE_ENCODER_OUT * sizeof *c.out);
    if (!c.in || !c.out) {
        error_set(err, EX_OSERR, "no memory for the encoders' bench");
        goto out;
    }
    random_init(&r, 2, "bench encoder");
    for (size_t i = 0; i < m; i++)
        c.in[i] = (float)random_uniform(&r);
    rc = 0;
    for (int k = 0; k < 6 && rc == 0; k++)
        if (k % 2 == 0 || b->threads > 1)
            rc = bench_net(b, &c, truth, types[k / 2], k % 2 ? b->threads : 1,
                           err);
    bench_note(b, "%s: errors are against f32 on one thread (golden 01 holds "
               "that to double); 0 between threads means the same bits",
               shape ? "shape" : "motion");
out:
    parallel_set_width(before);
    model_close(&c.model);
    free(c.in);
    free(c.out);
    return rc;
}

/* ---- the heads -------------------------------------------------------- */

/* A hundred decodings. */
static int bench_call_heads(void *context, struct error *err)
{
    struct motion m;

    (void)err;
    for (int i = 0; i < 100; i++)
        track_decode(&m, context, (struct square){250, 260, 280}, 512);
    return 0;
}

/* The row of decoding. */
static int bench_heads(struct bench *b, struct error *err)
{
    float out[MOTION_OUT] = {1, 0, 0, 0, -1, 0, 0, 0, 7};
    struct bench_times t;

    if (bench_time(&t, b->seconds / 40, 20, bench_call_heads, out, err) != 0)
        return -1;
    t.min /= 100;
    t.median /= 100;
    t.p95 /= 100;
    return bench_add(b, "heads", "6D to R, t' to t, crop", "default", 1, &t,
                     NAN, NAN) ? 0 : -1;
}

int bench_motion(struct bench *b, struct error *err)
{
    const size_t first = b->rows;

    if (bench_crop(b, err) || bench_nets(b, false, err)
        || bench_heads(b, err))
        return -1;
    bench_pareto(b, first);
    return 0;
}

int bench_shape(struct bench *b, struct error *err)
{
    const size_t first = b->rows;

    if (bench_nets(b, true, err))
        return -1;
    bench_pareto(b, first);
    return 0;
}
