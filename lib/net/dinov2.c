/* DINOv2's vision transformer (Oquab et al. 2023), forward and backward. */
#include "lib/net/dinov2.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"
#include "lib/nn/attention.h"
#include "lib/nn/conv.h"
#include "lib/nn/image.h"
#include "lib/nn/rescale.h"
#include "lib/nn/transformer.h"

#define EPS 1e-6f
#define OFFSET 0.1               /* of the public code's position resizing */

struct dinov2_impl {
    struct nn_plan plan;
    struct params *ps;
    struct conv patch;
    size_t cls, pos, registers;
    struct layer_norm norm;
    struct transformer *block;
    struct attention attention;
    struct rescale resize;
    bool native;                 /* no resizing of the positions */
    const float *rgb;
    float *patches, *position;   /* (B,gh*gw,E), (tokens,E) */
    float *out;                  /* after the last block */
    float **given, **given_stat; /* normalised, `last` of them */
    struct transformer_gradient gradient;
    float *dpos;
};

/* The names of the public checkpoints. */
static const struct transformer_kind kind = {
    .norm1 = "norm1", .in = {"attn.qkv"}, .out = "attn.proj",
    .scale1 = "ls1.gamma", .norm2 = "norm2", .grow = "mlp.fc1",
    .shrink = "mlp.fc2", .scale2 = "ls2.gamma", .widen = 4, .act = ACT_GELU,
    .eps1 = EPS, .eps2 = EPS
};

int dinov2_init(struct dinov2 *d, struct params *ps, const char *prefix,
                const struct dinov2_config *c, bool frozen, struct error *err)
{
    char name[120];

    memset(d, 0, sizeof *d);
    if (!c->embed || !c->depth || !c->heads || c->embed % c->heads ||
        !c->patch || !c->grid || !c->last || c->last > c->depth)
        return error_set(err, EX_CONFIG, "vision transformer of embed %zu, "
                         "depth %zu, %zu heads, patch %zu, last %zu (expected "
                         "heads to divide embed, last at most depth)",
                         c->embed, c->depth, c->heads, c->patch, c->last);
    struct dinov2_impl *im = calloc(1, sizeof *im);
    d->impl = im;
    if (im)
        im->block = calloc(c->depth, sizeof *im->block);
    if (!im || !im->block)
        return error_set(err, EX_OSERR, "out of memory");
    d->config = *c;
    im->ps = ps;
    size_t first = ps->count, E = c->embed, P = c->patch;
    size_t pos[3] = { 1, 1 + c->grid * c->grid, E }, cls[3] = { 1, 1, E };
    im->cls = params_add(ps, nn_name(name, "%scls_token", prefix), 3, cls,
                         PARAM_NORMAL, 0.02f);
    im->pos = params_add(ps, nn_name(name, "%spos_embed", prefix), 3, pos,
                         PARAM_NORMAL, 0.02f);
    if (c->registers)
        im->registers = params_add(ps, nn_name(name, "%sregister_tokens",
                                               prefix), 3,
                                   (size_t[]){ 1, c->registers, E },
                                   PARAM_NORMAL, 0.02f);
    /* part of the public checkpoints, used in their pre-training only */
    params_add(ps, nn_name(name, "%smask_token", prefix), 2, cls + 1,
               PARAM_ZERO, 0);
    conv_init(&im->patch, ps, nn_name(name, "%spatch_embed.proj", prefix), 3,
              E, P, P, true);
    im->patch.pad = CONV_NONE;
    for (size_t i = 0; i < c->depth; i++)
        transformer_init(&im->block[i], ps,
                         nn_name(name, "%sblocks.%zu.", prefix, i), &kind, E,
                         c->heads);
    layer_norm_init(&im->norm, ps, nn_name(name, "%snorm", prefix), E, EPS);
    for (size_t i = first; i < ps->count; i++)
        ps->tensor[i].frozen = frozen;
    return 0;
}

/* The position embedding of the plan's grid. */
static void dinov2_update_position(void *dinov2)
{
    const struct dinov2 *d = dinov2;
    struct dinov2_impl *im = d->impl;
    const float *pos = param_w(im->ps, im->pos);
    size_t E = d->config.embed;

    if (im->native) {
        memcpy(im->position, pos, (d->tokens - d->config.registers) * E *
                                      sizeof *pos);
        return;
    }
    memcpy(im->position, pos, E * sizeof *pos);
    rescale_forward(im->position + E, pos + E, &im->resize);
}

/* The position embedding, resized as the public code does (with its
 * offset). */
static void dinov2_plan_position(struct dinov2 *d, size_t height, size_t width)
{
    struct dinov2_impl *im = d->impl;
    struct nn_plan *p = &im->plan;
    size_t G = d->config.grid, E = d->config.embed;

    im->native = height == width && d->grid_h == G && d->grid_w == G;
    im->position = nn_plan_floats(p, (d->tokens - d->config.registers) * E);
    nn_plan_layer(p, (struct nn_layer){d, dinov2_update_position, NULL});
    if (!im->native && d->config.registers)
        rescale_plan(&im->resize, p, RESCALE_BICUBIC_ANTIALIAS, 1, G, G,
                     d->grid_h, d->grid_w, E);
    else if (!im->native)
        rescale_plan_factor(&im->resize, p, RESCALE_BICUBIC, 1, G, G,
                            d->grid_h, d->grid_w,
                            ((double)d->grid_h + OFFSET) / (double)G,
                            ((double)d->grid_w + OFFSET) / (double)G, E);
}

/* All blocks; what they work in. */
static void dinov2_plan_blocks(struct dinov2 *d, size_t rows, size_t E)
{
    struct dinov2_impl *im = d->impl;
    struct nn_plan *p = &im->plan;
    const bool learns = nn_plan_backward(p);
    float *x = nn_plan_floats(p, rows * E);
    float *normed = learns ? NULL : nn_plan_map(p, rows * E);
    float *wide = learns ? NULL : nn_plan_map(p, rows * kind.widen * E);

    for (size_t i = 0; i < d->config.depth; i++) {
        struct transformer *t = &im->block[i];

        transformer_use(t, x, normed, wide, wide);
        transformer_plan(t, p, rows);
        if (learns)
            x = nn_plan_floats(p, rows * E);
    }
    im->out = x;
    nn_plan_recycle(p, normed);
    nn_plan_recycle(p, wide);
    if (!learns)
        return;
    if (d->config.registers)
        nn_plan_fail(p, EX_CONFIG, "a transformer with registers does not "
                     "learn here");
    const size_t G = d->config.grid;

    transformer_plan_gradient(&im->gradient, p, im->block);
    im->dpos = nn_plan_floats(p, (d->tokens + G * G) * E);
}

int dinov2_plan(struct dinov2 *d, size_t batch, size_t height, size_t width,
                struct nn_options opt, struct error *err)
{
    struct dinov2_impl *im = d->impl;
    const struct dinov2_config *c = &d->config;
    struct nn_plan *p = &im->plan;

    if (height % c->patch || width % c->patch || !height || !width)
        return error_set(err, EX_DATAERR, "a picture of %zux%zu for patches of"
                         " %zu (expected multiples)", width, height, c->patch);
    nn_plan_release(p);
    nn_plan_init(p, opt);
    d->batch = batch;
    d->grid_h = height / c->patch;
    d->grid_w = width / c->patch;
    d->tokens = 1 + c->registers + d->grid_h * d->grid_w;
    size_t rows = batch * d->tokens, E = c->embed;
    im->patches = nn_plan_floats(p, rows * E);
    conv_plan(&im->patch, p, batch, height, width);
    dinov2_plan_position(d, height, width);
    attention_plan(&im->attention, p, batch, d->tokens, c->heads,
                   E / c->heads);
    dinov2_plan_blocks(d, rows, E);
    im->given = nn_plan_bytes(p, 2 * c->last * sizeof *im->given);
    im->given_stat = im->given ? im->given + c->last : NULL;
    for (size_t i = 0; i < c->last && im->given; i++) {
        im->given[i] = nn_plan_floats(p, rows * E);
        im->given_stat[i] = nn_plan_floats(p, 2 * rows);
    }
    return nn_plan_finish(p, err);
}

void dinov2_release(struct dinov2 *d)
{
    struct dinov2_impl *im = d->impl;

    if (!im)
        return;
    nn_plan_release(&im->plan);
    free(im->block);
    free(im);
    memset(d, 0, sizeof *d);
}

/* ---- one pass ------------------------------------------------------------ */

PARALLEL(dinov2_forward_part, k, struct dinov2_impl *, im,
         const struct params *, ps, float *, x, size_t, T, size_t, R, size_t, E)
{
    size_t n = k / T, t = k % T, patch = t - 1 - R;
    const float *from = t == 0 ? param_w(ps, im->cls)
                      : t <= R ? param_w(ps, im->registers) + (t - 1) * E
                      : im->patches + (n * (T - 1 - R) + patch) * E;
    const float *at = t == 0 ? im->position : im->position + (t - R) * E;

    for (size_t e = 0; e < E; e++)      /* a register has no place */
        x[(n * T + t) * E + e] = from[e] + (t == 0 || t > R ? at[e] : 0);
}

/* Which block is given out as the k-th.  Of 24 spread ones the public code
 * takes 4, not 5. */
static size_t dinov2_given(const struct dinov2_config *c, size_t k)
{
    if (!c->spread)
        return c->depth - c->last + k;
    return c->depth * (k + 1) / c->last - 1 - (c->depth == 24 && k == 0);
}

void dinov2_forward(const float *rgb, struct dinov2 *d)
{
    struct dinov2_impl *im = d->impl;
    const struct params *ps = im->ps;
    size_t E = d->config.embed, T = d->tokens, depth = d->config.depth;
    float *x = im->block[0].x;

    im->rgb = rgb;
    conv_forward(im->patches, rgb, &im->patch);

    parallel_each(dinov2_forward_part, d->batch * T, 1, im, ps, x, T,
                  d->config.registers, E);
    for (size_t i = 0, k = 0; i < depth; i++) {
        float *next = i + 1 < depth ? im->block[i + 1].x : im->out;

        transformer_forward(next, &im->block[i], &im->attention);
        if (i != dinov2_given(&d->config, k))
            continue;
        layer_norm_forward(im->given[k], im->given_stat[k], next, &im->norm,
                           d->batch * T);
        k++;
    }
}

const float *dinov2_tokens(const struct dinov2 *d, size_t k)
{
    return d->impl->given[k];
}

const float *dinov2_raw(const struct dinov2 *d, size_t k)
{
    return k < d->config.depth ? d->impl->block[k].x : d->impl->out;
}

const float *dinov2_position(const struct dinov2 *d)
{
    return d->impl->position;
}

/* ---- and back ------------------------------------------------------------ */

/* The embeddings: dcls, dpos, and the patches' gradient to ds. */
static void dinov2_embedding_backward(struct dinov2 *d)
{
    struct dinov2_impl *im = d->impl;
    struct transformer_gradient *to = &im->gradient;
    size_t E = d->config.embed, T = d->tokens, G = d->config.grid;
    float *dpos = im->dpos, *dcls = param_g(im->ps, im->cls);
    float *grid = dpos + T * E, *g = param_g(im->ps, im->pos);

    memset(dpos, 0, T * E * sizeof *dpos);
    for (size_t n = 0; n < d->batch; n++) {
        const float *dx = to->dx + n * T * E;

        for (size_t i = 0; i < T * E; i++)
            dpos[i] += dx[i];
        for (size_t e = 0; e < E; e++)
            dcls[e] += dx[e];
        memcpy(to->ds + n * (T - 1) * E, dx + E, (T - 1) * E * sizeof *dx);
    }
    if (im->native) {
        image_add(g, dpos, T * E);
        return;
    }
    for (size_t e = 0; e < E; e++)
        g[e] += dpos[e];
    rescale_backward(grid, dpos + E, &im->resize);
    image_add(g + E, grid, G * G * E);
}

void dinov2_backward(float *drgb, const float *const *dtokens,
                     struct dinov2 *d)
{
    struct dinov2_impl *im = d->impl;
    struct transformer_gradient *to = &im->gradient;
    size_t rows = d->batch * d->tokens, depth = d->config.depth;

    memset(to->dx, 0, rows * d->config.embed * sizeof *to->dx);
    for (size_t i = depth; i-- > 0;) {
        const float *x = dinov2_raw(d, i + 1);
        size_t k = i + d->config.last - depth;

        if (i + d->config.last >= depth && dtokens[k])
            transformer_norm_backward(to, dtokens[k], x, im->given_stat[k],
                                      &im->norm, rows);
        transformer_backward(to, &im->block[i], &im->attention);
    }
    dinov2_embedding_backward(d);
    conv_backward(drgb, to->ds, im->patches, im->rgb, &im->patch);
}
