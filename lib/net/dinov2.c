/* DINOv2's vision transformer (Oquab et al. 2023); frozen, so forward only. */
#include "lib/net/dinov2.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"
#include "lib/nn/attention.h"
#include "lib/nn/conv.h"
#include "lib/nn/image.h"
#include "lib/nn/kernels.h"
#include "lib/nn/rescale.h"

#define EPS 1e-6f
#define OFFSET 0.1               /* of the public code's position resizing */

struct dinov2_block {
    struct conv qkv, proj, fc1, fc2;
    size_t norm1[2], norm2[2];   /* weight, bias in ps */
    size_t scale1, scale2;       /* LayerScale */
    float *n1, *n2, *heads, *att, *f1;   /* activations, (rows, ...) */
};

struct dinov2_impl {
    struct nn_plan plan;
    struct params *ps;
    struct conv patch;
    size_t cls, pos, norm[2];
    struct dinov2_block *block;
    struct attention attention;
    struct rescale resize;
    bool native;                 /* no resizing of the positions */
    float *patches, *position;   /* (B,gh*gw,E), (tokens,E) */
    float *x;                    /* (B,tokens,E), before and after each block */
    float **given;               /* normalised, `last` of them */
};

/* A vector of n weights. */
static size_t dinov2_declare(struct params *ps, const char *prefix,
                             const char *name, size_t n, enum param_init init,
                             float gain)
{
    char buf[120];

    return params_add(ps, nn_name(buf, "%s%s", prefix, name), 1, &n, init,
                      gain);
}

/* A transformer block of width E, its tensors under `at`. */
static void dinov2_block_init(struct dinov2_block *b, struct params *ps,
                              const char *at, size_t E)
{
    char name[120];

    b->norm1[0] = dinov2_declare(ps, at, "norm1.weight", E, PARAM_ONE, 1);
    b->norm1[1] = dinov2_declare(ps, at, "norm1.bias", E, PARAM_ZERO, 0);
    linear_init(&b->qkv, ps, nn_name(name, "%sattn.qkv", at), E, 3 * E, true);
    linear_init(&b->proj, ps, nn_name(name, "%sattn.proj", at), E, E, true);
    b->scale1 = dinov2_declare(ps, at, "ls1.gamma", E, PARAM_CONSTANT, 0.1f);
    b->norm2[0] = dinov2_declare(ps, at, "norm2.weight", E, PARAM_ONE, 1);
    b->norm2[1] = dinov2_declare(ps, at, "norm2.bias", E, PARAM_ZERO, 0);
    linear_init(&b->fc1, ps, nn_name(name, "%smlp.fc1", at), E, 4 * E, true);
    linear_init(&b->fc2, ps, nn_name(name, "%smlp.fc2", at), 4 * E, E, true);
    b->scale2 = dinov2_declare(ps, at, "ls2.gamma", E, PARAM_CONSTANT, 0.1f);
}

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
    /* part of the public checkpoints, used in their pre-training only */
    params_add(ps, nn_name(name, "%smask_token", prefix), 2, cls + 1,
               PARAM_ZERO, 0);
    conv_init(&im->patch, ps, nn_name(name, "%spatch_embed.proj", prefix), 3,
              E, P, P, true);
    im->patch.pad = CONV_NONE;
    for (size_t i = 0; i < c->depth; i++)
        dinov2_block_init(&im->block[i], ps,
                          nn_name(name, "%sblocks.%zu.", prefix, i), E);
    im->norm[0] = dinov2_declare(ps, prefix, "norm.weight", E, PARAM_ONE, 1);
    im->norm[1] = dinov2_declare(ps, prefix, "norm.bias", E, PARAM_ZERO, 0);
    for (size_t i = first; i < ps->count; i++)
        ps->tensor[i].frozen = frozen;
    return 0;
}

/* The buffers of a block that live only inside it may be another's too. */
static void dinov2_block_plan(struct dinov2_block *b, struct nn_plan *p,
                              size_t rows, size_t E)
{
    b->proj.add = b->fc2.add = true;
    b->proj.gamma = b->scale1;
    b->fc2.gamma = b->scale2;
    b->fc1.act = ACT_GELU;
    b->n1 = nn_plan_map(p, rows * E);
    b->heads = nn_plan_map(p, rows * 3 * E);
    linear_plan(&b->qkv, p, rows);
    nn_plan_recycle(p, b->n1);
    b->att = nn_plan_map(p, rows * E);
    nn_plan_recycle(p, b->heads);
    linear_plan(&b->proj, p, rows);
    nn_plan_recycle(p, b->att);
    b->n2 = nn_plan_map(p, rows * E);
    b->f1 = nn_plan_map(p, rows * 4 * E);
    linear_plan(&b->fc1, p, rows);
    linear_plan(&b->fc2, p, rows);
    nn_plan_recycle(p, b->n2);
    nn_plan_recycle(p, b->f1);
}

/* The position embedding, resized as the public code does (with its
 * offset). */
static void dinov2_plan_position(struct dinov2 *d, size_t height, size_t width)
{
    struct dinov2_impl *im = d->impl;
    struct nn_plan *p = &im->plan;
    size_t G = d->config.grid, E = d->config.embed;

    im->native = height == width && d->grid_h == G && d->grid_w == G;
    im->position = nn_plan_floats(p, d->tokens * E);
    if (!im->native)
        rescale_plan_factor(&im->resize, p, 1, G, G, d->grid_h, d->grid_w,
                            ((double)d->grid_h + OFFSET) / (double)G,
                            ((double)d->grid_w + OFFSET) / (double)G, E);
}

int dinov2_plan(struct dinov2 *d, size_t batch, size_t height, size_t width,
                enum nn_type type, struct error *err)
{
    struct dinov2_impl *im = d->impl;
    const struct dinov2_config *c = &d->config;
    struct nn_plan *p = &im->plan;

    if (height % c->patch || width % c->patch || !height || !width)
        return error_set(err, EX_DATAERR, "a picture of %zux%zu for patches of"
                         " %zu (expected multiples)", width, height, c->patch);
    nn_plan_release(p);
    nn_plan_init(p, (struct nn_options){ NN_INFER, type });
    d->batch = batch;
    d->grid_h = height / c->patch;
    d->grid_w = width / c->patch;
    d->tokens = 1 + d->grid_h * d->grid_w;
    size_t rows = batch * d->tokens, E = c->embed;
    im->patches = nn_plan_floats(p, rows * E);
    conv_plan(&im->patch, p, batch, height, width);
    dinov2_plan_position(d, height, width);
    attention_plan(&im->attention, p, batch, d->tokens, c->heads,
                   E / c->heads);
    im->x = nn_plan_floats(p, rows * E);
    for (size_t i = 0; i < c->depth; i++)
        dinov2_block_plan(&im->block[i], p, rows, E);
    im->given = nn_plan_bytes(p, c->last * sizeof *im->given);
    for (size_t i = 0; i < c->last && im->given; i++)
        im->given[i] = nn_plan_floats(p, rows * E);
    if (nn_plan_finish(p, err))
        return -1;
    dinov2_update(d);
    return 0;
}

void dinov2_update(struct dinov2 *d)
{
    struct dinov2_impl *im = d->impl;
    size_t E = d->config.embed;
    const float *pos = param_w(im->ps, im->pos);

    conv_update(&im->patch, NULL);
    for (size_t i = 0; i < d->config.depth; i++) {
        struct dinov2_block *b = &im->block[i];

        conv_update(&b->qkv, NULL);
        conv_update(&b->proj, NULL);
        conv_update(&b->fc1, NULL);
        conv_update(&b->fc2, NULL);
    }
    if (im->native) {
        memcpy(im->position, pos, d->tokens * E * sizeof *pos);
        return;
    }
    memcpy(im->position, pos, E * sizeof *pos);
    rescale_forward(im->position + E, pos + E, &im->resize);
}

void dinov2_release(struct dinov2 *d)
{
    struct dinov2_impl *im = d->impl;

    if (!im)
        return;
    conv_release(&im->patch);
    for (size_t i = 0; im->block && i < d->config.depth; i++) {
        conv_release(&im->block[i].qkv);
        conv_release(&im->block[i].proj);
        conv_release(&im->block[i].fc1);
        conv_release(&im->block[i].fc2);
    }
    nn_plan_release(&im->plan);
    free(im->block);
    free(im);
    memset(d, 0, sizeof *d);
}

/* y = layer norm of x with weight and bias wb. */
static void dinov2_norm(float *y, const float *x, const size_t wb[2],
                        size_t rows, size_t E, const struct params *ps)
{
    layer_norm(y, x, param_w(ps, wb[0]), param_w(ps, wb[1]), EPS, rows, E);
}

/* x += ls1 attn(norm1 x); x += ls2 mlp(norm2 x) */
static void dinov2_block_forward(struct dinov2_block *b, struct dinov2 *d)
{
    struct dinov2_impl *im = d->impl;
    size_t rows = d->batch * d->tokens, E = d->config.embed;

    dinov2_norm(b->n1, im->x, b->norm1, rows, E, im->ps);
    conv_forward(b->heads, b->n1, &b->qkv);
    attention_forward(b->att, b->heads, &im->attention);
    conv_forward(im->x, b->att, &b->proj);
    dinov2_norm(b->n2, im->x, b->norm2, rows, E, im->ps);
    conv_forward(b->f1, b->n2, &b->fc1);
    conv_forward(im->x, b->f1, &b->fc2);
}

struct dinov2_forward_part {
    struct dinov2_impl *im;
    const struct params *ps;
    float *x;
    size_t T, E;
};

static void dinov2_forward_part(void *ctx, size_t k)
{
    const struct dinov2_forward_part *c = ctx;
    size_t n = k / c->T, t = k % c->T;
    const float *from = t ? c->im->patches + (n * (c->T - 1) + t - 1) * c->E
                          : param_w(c->ps, c->im->cls);

    for (size_t e = 0; e < c->E; e++)
        c->x[(n * c->T + t) * c->E + e] =
            from[e] + c->im->position[t * c->E + e];
}

void dinov2_forward(const float *rgb, struct dinov2 *d)
{
    struct dinov2_impl *im = d->impl;
    const struct params *ps = im->ps;
    size_t E = d->config.embed, T = d->tokens, depth = d->config.depth;

    conv_forward(im->patches, rgb, &im->patch);

    parallel_for(d->batch * T, 1, dinov2_forward_part,
                 &(struct dinov2_forward_part){ im, ps, im->x, T, E });
    for (size_t i = 0; i < depth; i++) {
        dinov2_block_forward(&im->block[i], d);
        if (i + d->config.last >= depth)
            dinov2_norm(im->given[i + d->config.last - depth], im->x, im->norm,
                        d->batch * T, E, ps);
    }
}

const float *dinov2_tokens(const struct dinov2 *d, size_t k)
{
    return d->impl->given[k];
}

const float *dinov2_position(const struct dinov2 *d)
{
    return d->impl->position;
}
