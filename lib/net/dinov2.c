/* DINOv2's vision transformer (Oquab et al. 2023), forward and backward. */
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
    /* activations, (rows, ...); kept per block when there is a backward */
    float *x, *mid;              /* the block's input; after attention */
    float *n1, *n2, *stat1, *stat2;
    float *heads, *att, *p, *f1, *g, *f2;
};

struct dinov2_impl {
    struct nn_plan plan;
    struct params *ps;
    struct conv patch;
    size_t cls, pos, registers, norm[2];
    struct dinov2_block *block;
    struct attention attention;
    struct rescale resize;
    bool native;                 /* no resizing of the positions */
    const float *rgb;
    float *patches, *position;   /* (B,gh*gw,E), (tokens,E) */
    float *out;                  /* after the last block */
    float **given, **given_stat; /* normalised, `last` of them */
    /* gradients */
    float *dx, *ds, *dn, *dwide, *dpos, *sums;
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
    bool train = nn_plan_backward(p);
    struct conv *last[2] = { &b->proj, &b->fc2 };
    size_t gamma[2] = { b->scale1, b->scale2 };

    for (int i = 0; i < 2; i++) {
        last[i]->add = !train;
        last[i]->gamma = train ? NN_NONE : gamma[i];
    }
    b->fc1.act = train ? ACT_NONE : ACT_GELU;
    b->n1 = nn_plan_map(p, rows * E);
    b->stat1 = nn_plan_map(p, 2 * rows);
    b->heads = nn_plan_map(p, rows * 3 * E);
    linear_plan(&b->qkv, p, rows);
    nn_plan_recycle(p, b->n1);
    b->att = nn_plan_map(p, rows * E);
    nn_plan_recycle(p, b->heads);
    linear_plan(&b->proj, p, rows);
    nn_plan_recycle(p, b->att);
    b->n2 = nn_plan_map(p, rows * E);
    b->stat2 = nn_plan_map(p, 2 * rows);
    b->f1 = nn_plan_map(p, rows * 4 * E);
    linear_plan(&b->fc1, p, rows);
    b->g = train ? nn_plan_map(p, rows * 4 * E) : b->f1;
    linear_plan(&b->fc2, p, rows);
    nn_plan_recycle(p, b->n2);
    nn_plan_recycle(p, b->f1);
    nn_plan_recycle(p, b->stat1);
    nn_plan_recycle(p, b->stat2);
    b->mid = train ? nn_plan_map(p, rows * E) : b->x;
    b->p = train ? nn_plan_map(p, rows * E) : NULL;
    b->f2 = train ? nn_plan_map(p, rows * E) : NULL;
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

/* What the backward pass needs besides, for rows tokens of E numbers. */
static void dinov2_plan_backward(struct dinov2 *d, size_t rows, size_t E)
{
    struct dinov2_impl *im = d->impl;
    struct nn_plan *p = &im->plan;
    const size_t G = d->config.grid;

    im->dx = nn_plan_floats(p, rows * E);
    im->ds = nn_plan_floats(p, rows * E);
    im->dn = nn_plan_floats(p, rows * E);
    im->dwide = nn_plan_floats(p, 2 * rows * 4 * E);
    im->dpos = nn_plan_floats(p, (d->tokens + G * G) * E);
    im->sums = nn_plan_floats(p, NN_SUMS * 2 * E);
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
    float *x = nn_plan_floats(p, rows * E);
    for (size_t i = 0; i < c->depth; i++) {
        im->block[i].x = x;
        dinov2_block_plan(&im->block[i], p, rows, E);
        if (nn_plan_backward(p))
            x = nn_plan_floats(p, rows * E);
    }
    im->out = x;
    im->given = nn_plan_bytes(p, 2 * c->last * sizeof *im->given);
    im->given_stat = im->given ? im->given + c->last : NULL;
    for (size_t i = 0; i < c->last && im->given; i++) {
        im->given[i] = nn_plan_floats(p, rows * E);
        im->given_stat[i] = nn_plan_floats(p, 2 * rows);
    }
    if (nn_plan_backward(p) && c->registers)
        nn_plan_fail(p, EX_CONFIG, "a transformer with registers does not "
                     "learn here");
    if (nn_plan_backward(p))
        dinov2_plan_backward(d, rows, E);
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

/* ---- one pass -------------------------------------------------------------
 */

/* y = layer norm of x with weight and bias wb; stat (2,rows) is kept. */
static void dinov2_norm(float *y, float *stat, const float *x,
                        const size_t wb[2], size_t rows, size_t E,
                        const struct params *ps)
{
    layer_norm_forward(y, stat, stat + rows, x, param_w(ps, wb[0]),
                       param_w(ps, wb[1]), EPS, rows, E);
}

/* One chunk. */
PARALLEL(dinov2_residual_part, part, const struct nn_kernels *, k, float *, y,
         const float *, x, const float *, p, const struct params *, ps,
         size_t, E, size_t, gamma, size_t, rows)
{
    size_t r = part * 16;

    k->scale_add(y + r * E, x + r * E, p + r * E, param_w(ps, gamma),
                 rows - r < 16 ? rows - r : 16, E);
}

/* y = x + gamma p */
static void dinov2_residual(float *y, const float *x, const float *p,
                            size_t gamma, size_t rows, size_t E,
                            const struct params *ps)
{
    const struct nn_kernels *k = nn_kernels();

    parallel_each(dinov2_residual_part, (rows + 16 - 1) / 16, 1, k, y, x, p, ps,
                  E, gamma, rows);
}

/* x += ls1 attn(norm1 x); x += ls2 mlp(norm2 x); to `next` or in place */
static void dinov2_block_forward(float *next, struct dinov2_block *b,
                                 struct dinov2 *d)
{
    struct dinov2_impl *im = d->impl;
    const struct params *ps = im->ps;
    size_t rows = d->batch * d->tokens, E = d->config.embed;
    bool train = nn_plan_backward(&im->plan);

    dinov2_norm(b->n1, b->stat1, b->x, b->norm1, rows, E, ps);
    conv_forward(b->heads, b->n1, &b->qkv);
    attention_forward(b->att, b->heads, &im->attention);
    conv_forward(train ? b->p : b->x, b->att, &b->proj);
    if (train)
        dinov2_residual(b->mid, b->x, b->p, b->scale1, rows, E, ps);
    dinov2_norm(b->n2, b->stat2, b->mid, b->norm2, rows, E, ps);
    conv_forward(b->f1, b->n2, &b->fc1);
    if (train)
        act_forward(b->g, b->f1, ACT_GELU, rows * 4 * E);
    conv_forward(train ? b->f2 : b->x, b->g, &b->fc2);
    if (train)
        dinov2_residual(next, b->mid, b->f2, b->scale2, rows, E, ps);
}

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

        dinov2_block_forward(next, &im->block[i], d);
        if (i != dinov2_given(&d->config, k))
            continue;
        dinov2_norm(im->given[k], im->given_stat[k], next, im->norm,
                    d->batch * T, E, ps);
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

/* ---- and back -------------------------------------------------------------
 */

/* dx = or += the gradient through norm */
static void dinov2_norm_backward(float *dx, float *tmp, const float *dy,
                                 const float *x, const float *stat,
                                 const size_t wb[2], size_t rows, size_t E,
                                 struct dinov2_impl *im)
{
    layer_norm_backward(tmp, param_g(im->ps, wb[0]), param_g(im->ps, wb[1]),
                        im->sums, dy, x, stat, stat + rows,
                        param_w(im->ps, wb[0]), rows, E);
    image_add(dx, tmp, rows * E);
}

/* In the forward pass: y = x + gamma p.  dp = gamma dy, dgamma += dy p. */
static void dinov2_residual_backward(float *dp, const float *dy,
                                     const float *p, size_t gamma, size_t rows,
                                     size_t E, struct dinov2_impl *im)
{
    const float *g = param_w(im->ps, gamma);
    float *dg = param_g(im->ps, gamma);

    nn_kernels()->channel_dot(im->sums, dy, p, rows, E);
    for (size_t e = 0; e < E; e++)
        dg[e] += im->sums[e];
    nn_kernels()->channel_scale(dp, dy, g, NULL, rows, E);
}

/* im->dx: gradient after the block; on return, before it. */
static void dinov2_block_backward(struct dinov2_block *b, struct dinov2 *d)
{
    struct dinov2_impl *im = d->impl;
    size_t rows = d->batch * d->tokens, E = d->config.embed;
    float *wide = im->dwide, *wide2 = wide + rows * 4 * E;

    dinov2_residual_backward(im->ds, im->dx, b->f2, b->scale2, rows, E, im);
    conv_backward(wide, im->ds, b->f2, b->g, &b->fc2);
    act_backward(wide, wide, b->f1, ACT_GELU, rows * 4 * E);
    conv_backward(im->dn, wide, b->f1, b->n2, &b->fc1);
    dinov2_norm_backward(im->dx, im->ds, im->dn, b->mid, b->stat2, b->norm2,
                         rows, E, im);
    dinov2_residual_backward(im->ds, im->dx, b->p, b->scale1, rows, E, im);
    conv_backward(im->dn, im->ds, b->p, b->att, &b->proj);
    attention_backward(wide2, im->dn, b->heads, &im->attention);
    conv_backward(im->dn, wide2, b->heads, b->n1, &b->qkv);
    dinov2_norm_backward(im->dx, im->ds, im->dn, b->x, b->stat1, b->norm1,
                         rows, E, im);
}

/* The embeddings: dcls, dpos, and the patches' gradient to im->ds. */
static void dinov2_embedding_backward(struct dinov2 *d)
{
    struct dinov2_impl *im = d->impl;
    size_t E = d->config.embed, T = d->tokens, G = d->config.grid;
    float *dpos = im->dpos, *dcls = param_g(im->ps, im->cls);
    float *grid = dpos + T * E, *g = param_g(im->ps, im->pos);

    memset(dpos, 0, T * E * sizeof *dpos);
    for (size_t n = 0; n < d->batch; n++) {
        const float *dx = im->dx + n * T * E;

        for (size_t i = 0; i < T * E; i++)
            dpos[i] += dx[i];
        for (size_t e = 0; e < E; e++)
            dcls[e] += dx[e];
        memcpy(im->ds + n * (T - 1) * E, dx + E, (T - 1) * E * sizeof *dx);
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
    size_t rows = d->batch * d->tokens, E = d->config.embed;
    size_t depth = d->config.depth;

    memset(im->dx, 0, rows * E * sizeof *im->dx);
    for (size_t i = depth; i-- > 0;) {
        const float *x = dinov2_raw(d, i + 1);
        size_t k = i + d->config.last - depth;

        if (i + d->config.last >= depth && dtokens[k])
            dinov2_norm_backward(im->dx, im->ds, dtokens[k], x,
                                 im->given_stat[k], im->norm, rows, E, im);
        dinov2_block_backward(&im->block[i], d);
    }
    dinov2_embedding_backward(d);
    conv_backward(drgb, im->ds, im->patches, im->rgb, &im->patch);
}
