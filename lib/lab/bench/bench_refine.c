/* The refiners, Eq. SR: the narrow one that ships and StyleUNet at full
 * width, in every precision, time beside error. */
#include "lib/lab/bench/bench.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/arena.h"
#include "lib/base/parallel.h"
#include "lib/base/random.h"
#include "lib/net/model.h"
#include "lib/net/refiner.h"
#include "lib/photo/texture.h"

#define SIDE 512
#define CHANNELS 32
#define PIXELS ((size_t)SIDE * SIDE)

struct refine_case {
    struct bench *b;
    char config[96];
    struct refiner_config refiner;
    struct model model;          /* when one is given */
    bool trained;                /* the weights are the model's */
    struct params ps;
    struct refiner net;
    struct arena memory;
    float *feat, *rgb;           /* (PIXELS,CHANNELS), (PIXELS,3) */
    double *truth;               /* (PIXELS,3) */
    float *photo;                /* (PIXELS,TEXTURE_PHOTO) what it is shown */
};

/* The network on the whole picture. */
static int refine_case_call(void *context, struct error *err)
{
    struct refine_case *c = context;

    (void)err;
    refiner_forward(c->rgb, c->feat, &c->net);
    return 0;
}

/* A smooth picture with grain, and features about as large. */
static int refine_case_features(struct refine_case *c, struct error *err)
{
    struct random r;

    c->feat = arena_take(&c->memory, PIXELS * CHANNELS, sizeof *c->feat);
    c->rgb = arena_take(&c->memory, PIXELS * 3, sizeof *c->rgb);
    c->truth = arena_take(&c->memory, PIXELS * 3, sizeof *c->truth);
    c->photo = arena_take(&c->memory, PIXELS * TEXTURE_PHOTO,
                          sizeof *c->photo);
    if (arena_check(&c->memory, "the refiner's bench", err))
        return -1;
    random_init(&r, 3, "bench refine");
    for (size_t i = 0; i < PIXELS; i++) {
        double x = (double)(i % SIDE) / 40, y = (double)(i / SIDE) / 30;
        for (size_t k = 0; k < CHANNELS; k++) {
            double wave = sin(x + (double)k) * cos(y - 2 * (double)k);
            double grain = random_range(&r, -0.1, 0.1);
            c->feat[i * CHANNELS + k] =
                (float)(k < 3 ? 0.5 + 0.4 * wave + grain : wave + grain);
        }
        for (size_t k = 0; k < TEXTURE_PHOTO; k++)
            c->photo[i * TEXTURE_PHOTO + k] =
                k < 3 ? c->feat[i * CHANNELS + k] : 1;
    }
    return 0;
}

/* Random weights leave the narrow refiner without a correction, and let
 * StyleUNet's feature transforms blow values up level by level: last layers
 * and transforms such that values are about as large as in trained ones. */
static void refine_case_randomise(struct refine_case *c)
{
    params_randomise(&c->ps, 1);
    for (size_t t = 0; t < c->ps.count; t++) {
        const struct param *p = &c->ps.tensor[t];
        float *w = param_w(&c->ps, t), max = 0;
        struct random r;

        if (!strcmp(p->name, "refine.rgb.weight"))
            max = 0.03f;
        else if (strstr(p->name, "to_rgb") && strstr(p->name, "conv.weight"))
            max = 0.1f;
        else if (strstr(p->name, "condition_") && strstr(p->name, ".2.weight"))
            max = 0.005f;
        random_init(&r, 4, p->name);
        for (size_t i = 0; i < p->count && max > 0; i++)
            w[i] = max * (float)random_range(&r, -1, 1);
    }
}

/* One row; the first one's output is what the others are held against. */
static int refine_case_bench(struct refine_case *c, enum nn_type type,
                             int threads, bool truth, struct error *err)
{
    const struct nn_options opt = {NN_INFER, type};
    const bool narrow = c->refiner.type == REFINER_NARROW;
    double max = NAN, psnr = NAN;
    struct bench_times t;
    char key[24];
    int rc = -1;

    parallel_set_width(threads);
    params_init(&c->ps);
    if (refiner_init(&c->net, &c->ps, "refine.", &c->refiner, err) ||
        params_allocate(&c->ps, err) ||
        (c->trained && model_load(&c->ps, &c->model, "refine.", err)))
        goto out;
    if (!c->trained)
        refine_case_randomise(c);
    if (refiner_plan(&c->net, 1, SIDE, SIDE, opt, err))
        goto out;
    if (c->refiner.photo)
        refiner_photo(&c->net, c->photo);
    if (bench_time(&t, c->b->seconds / (narrow ? 20 : 8), 3, refine_case_call,
                   c, err))
        goto out;
    for (size_t i = 0; truth && i < PIXELS * 3; i++)
        c->truth[i] = c->rgb[i];
    if (!truth)
        bench_compare(&max, &psnr, c->rgb, c->truth, PIXELS * 3);
    if (bench_add(c->b, "refine", c->config, nn_type_name(type), threads, &t,
                  max, psnr))
        rc = 0;
    snprintf(key, sizeof key, "refine%s%s", type == NN_F32 ? "" : "_",
             type == NN_F32 ? "" : nn_type_name(type));
    if (narrow && threads == c->b->threads && rc == 0)
        bench_number(c->b, "ms", key, t.median);
out:
    refiner_release(&c->net);
    params_release(&c->ps);
    return rc;
}

/* The model's refiner if it has a narrow one of these sizes. */
static int refine_case_choose(struct refine_case *c, struct error *err)
{
    const struct avatar_config *config = &c->model.config;

    c->refiner = (struct refiner_config){
        .type = REFINER_NARROW, .channels = CHANNELS, .width = 32,
        .multiplier = 1, .size = SIDE
    };
    if (!c->b->model)
        return 0;
    if (model_open(&c->model, c->b->model, err))
        return -1;
    c->trained = config->has_refiner && config->channels == CHANNELS
        && config->refiner.type == REFINER_NARROW;
    if (c->trained)
        c->refiner = config->refiner;
    return 0;
}

static const enum nn_type refine_types[] = {NN_F32, NN_FAST, NN_BF16, NN_INT8};

/* How many of these there are: int8 only where the processor has it. */
static int refine_type_count(void)
{
    return nn_type_native(NN_INT8) ? 4 : 3;
}

/* The narrow refiner in every precision. */
static int refine_case_narrow(struct refine_case *c, struct error *err)
{
    const int threads = c->b->threads;

    if (refine_case_choose(c, err))
        return -1;
    snprintf(c->config, sizeof c->config, "narrow %zu, 512x512x32 %s",
             c->refiner.width, c->trained ? "model" : "untrained");
    for (int i = 0; i < refine_type_count(); i++)
        if (refine_case_bench(c, refine_types[i], 1, i == 0, err) ||
            (threads > 1 &&
             refine_case_bench(c, refine_types[i], threads, false, err)))
            return -1;
    return 0;
}

/* StyleUNet in every precision. */
static int refine_case_unet(struct refine_case *c, struct error *err)
{
    c->refiner = (struct refiner_config){
        .type = REFINER_STYLE_UNET, .channels = CHANNELS, .multiplier = 1,
        .size = SIDE
    };
    c->trained = false;
    snprintf(c->config, sizeof c->config, "StyleUNet, 512x512x32 untrained");
    for (int i = 0; i < refine_type_count(); i++)
        if (refine_case_bench(c, refine_types[i], c->b->threads, i == 0, err))
            return -1;
    return 0;
}

int bench_refine(struct bench *b, struct error *err)
{
    const size_t first = b->rows;
    const int before = parallel_width();
    struct refine_case c = {.b = b};
    int rc = -1;

    if (refine_case_features(&c, err) == 0 && refine_case_narrow(&c, err) == 0)
        rc = refine_case_unet(&c, err);
    if (rc == 0) {
        bench_note(b, "refine: errors are against f32 of the same network "
                   "(golden 05 holds that to double); pictures have a peak "
                   "of 1; StyleUNet's random weights make every rounding "
                   "larger (golden 05's network: 48 dB in int8, 61 in "
                   "bf16)");
        bench_pareto(b, first);
    }
    parallel_set_width(before);
    model_close(&c.model);
    arena_release(&c.memory);
    return rc;
}
