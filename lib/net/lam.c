/* LAM's forward pass up to the animation, step by step as the public code
 * has it. */
#include "lib/net/lam.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"
#include "lib/nn/math.h"

#define OCTAVES 8           /* of a point's place: sines of pi 2^k x */
#define EMBEDDED (3 * (2 * OCTAVES + 1))
#define EPS 1e-6f           /* of normalisations, but for those of NORM_EPS */
/* The public configuration's (lam-20k), in metres. */
#define REACH 0.2f          /* a Gaussian is within half of it from its vertex */
#define SCALE_MAX 0.01f     /* standard deviation */

/* ---- making ------------------------------------------------------------- */

/* The names of the public code: the points' stream, the picture's. */
static const struct transformer_kind streams[2] = {{
    .norm1 = "norm1", .in = {"attn.to_q", "attn.to_k", "attn.to_v"},
    .unit = {"attn.norm_q.weight", "attn.norm_k.weight"},
    .out = "attn.to_out.0", .grow = "ff.net.0.proj", .shrink = "ff.net.2",
    .widen = 4, .act = ACT_GELU_TANH, .eps1 = NORM_EPS, .eps2 = EPS
}, {
    .norm1 = "norm1_context",
    .in = {"attn.add_q_proj", "attn.add_k_proj", "attn.add_v_proj"},
    .unit = {"attn.norm_added_q.weight", "attn.norm_added_k.weight"},
    .out = "attn.to_add_out", .grow = "ff_context.net.0.proj",
    .shrink = "ff_context.net.2",
    .widen = 4, .act = ACT_GELU_TANH, .eps1 = NORM_EPS, .eps2 = EPS
}};

/* The encoder and what brings its features into the transformer. */
static int lam_declare_encoder(struct lam *l, struct error *err)
{
    const struct backbone_config *b = &l->config.backbone;
    const struct dinov2_config vit = {
        .embed = b->embed, .depth = b->depth, .heads = b->heads,
        .patch = b->patch, .grid = DINOV2_GRID, .last = LAM_LEVELS,
        .registers = b->registers, .spread = true
    };
    char name[120];

    if (dinov2_init(&l->vit, l->ps, "encoder.model.", &vit, true, err))
        return -1;
    for (int k = 0; k < LAM_LEVELS; k++)
        conv_init(&l->project[k], l->ps, nn_name(
            name, "encoder.fusion_head.projects.%d", k), b->embed, b->embed, 1,
            1, true);
    conv_init(&l->fuse, l->ps, "encoder.fusion_head.output_conv",
              LAM_LEVELS * b->embed, l->config.feature, 1, 1, true);
    linear_init(&l->condition, l->ps, "transformer.linear_cond_proj",
                l->config.feature, l->D);
    return 0;
}

/* The decoder of a point. */
static void lam_declare_decoder(struct lam *l)
{
    static const char *const head[LAM_HEADS] = {"shs", "scaling", "xyz",
                                                "opacity", "rotation"};
    static const size_t width[LAM_HEADS] = {3, 3, 3, 1, 4};
    const size_t hidden = l->config.dynamic_hidden;
    char name[120];

    for (int i = 0; i < LAM_DECODER; i++) {
        linear_init(&l->mlp[i], l->ps,
                    nn_name(name, "renderer.mlp_net.layers.%d", 2 * i),
                    i ? hidden : l->D, i + 1 < LAM_DECODER ? hidden : l->D);
        if (i + 1 < LAM_DECODER)
            l->mlp[i].act = ACT_SILU;
    }
    for (int k = 0; k < LAM_HEADS; k++)
        linear_init(&l->head[k], l->ps,
                    nn_name(name, "renderer.gs_net.out_layers.%s", head[k]),
                    l->D, width[k]);
}

/* Sizes that go together. */
static int lam_check(const struct avatar_config *c, struct error *err)
{
    const size_t heads = c->transformer_heads, patch = c->backbone.patch;

    if (c->channels != 3 || c->has_refiner)
        return error_set(err, EX_CONFIG, "lam with %zu channels and %s refiner "
                         "(expected 3 and none)", c->channels,
                         c->has_refiner ? "a" : "no");
    if (c->backbone.type != BACKBONE_DINOV2 || c->backbone.image % patch)
        return error_set(err, EX_CONFIG, "lam on a picture of %zu in patches "
                         "of %zu (expected a \"dinov2\" backbone and a "
                         "multiple)", c->backbone.image, patch);
    if (c->dynamic_width % heads)
        return error_set(err, EX_CONFIG, "dynamic.width %zu, "
                         "transformer.heads %zu (expected a multiple)",
                         c->dynamic_width, heads);
    return 0;
}

int lam_init(struct lam *l, struct params *ps, const struct avatar_config *c,
             struct error *err)
{
    memset(l, 0, sizeof *l);
    l->config = *c;
    l->ps = ps;
    l->D = c->dynamic_width;
    if (lam_check(c, err) || lam_declare_encoder(l, err))
        goto fail;
    l->block = calloc(c->transformer_layers, sizeof *l->block);
    if (!l->block) {
        error_set(err, EX_OSERR, "out of memory");
        goto fail;
    }
    linear_init(&l->embed, ps, "pcl_embed.mlp", EMBEDDED, l->D);
    layer_norm_init(&l->embed_norm, ps, "pcl_embed.norm", l->D, NORM_EPS);
    for (size_t i = 0; i < c->transformer_layers; i++) {
        char at[120];

        nn_name(at, "transformer.layers.%zu.", i);
        for (int k = 0; k < 2; k++) {
            struct transformer_kind kind = streams[k];

            if (k && i + 1 == c->transformer_layers)
                kind.out = NULL;
            transformer_init(&l->block[i][k], ps, at, &kind, l->D,
                             c->transformer_heads);
        }
    }
    layer_norm_init(&l->norm, ps, "transformer.norm", l->D, EPS);
    lam_declare_decoder(l);
    return 0;
fail:
    lam_release(l);
    return -1;
}

/* ---- planning ----------------------------------------------------------- */

static void lam_plan_layers(struct lam *l)
{
    struct nn_plan *p = &l->plan;
    const size_t rows[2] = {l->N, l->M};

    for (int k = 0; k < LAM_LEVELS; k++)
        linear_plan(&l->project[k], p, l->M);
    linear_plan(&l->fuse, p, l->M);
    linear_plan(&l->condition, p, l->M);
    linear_plan(&l->embed, p, l->N);
    for (size_t i = 0; i < l->config.transformer_layers; i++)
        for (int k = 0; k < 2; k++)
            transformer_plan(&l->block[i][k], p, rows[k]);
    for (int i = 0; i < LAM_DECODER; i++)
        linear_plan(&l->mlp[i], p, l->N);
    for (int k = 0; k < LAM_HEADS; k++)
        linear_plan(&l->head[k], p, l->N);
}

/* Maps, the largest of what takes turns in them; and the set's arrays. */
static int lam_allocate(struct lam *l, struct error *err)
{
    const size_t N = l->N, T = l->N + l->M, D = l->D;
    const size_t fused = LAM_LEVELS * l->config.backbone.embed * l->M;
    const size_t decoded = N * (2 * l->config.dynamic_hidden + D);
    size_t wide = 4 * T * D, side = l->config.backbone.image;
    struct nn_plan *p = &l->plan;

    wide = wide > 2 * fused ? wide : 2 * fused;
    wide = wide > decoded ? wide : decoded;
    wide = wide > N * EMBEDDED ? wide : N * EMBEDDED;
    l->picture = nn_plan_floats(p, side * side * 3);
    l->features = nn_plan_floats(p, l->M * l->config.feature);
    l->x = nn_plan_floats(p, T * D);
    l->normed = nn_plan_floats(p, T * D);
    l->wide = nn_plan_floats(p, wide);
    l->raw = nn_plan_floats(p, 4 * N);
    l->offset = nn_plan_floats(p, 3 * N);
    l->mean = nn_plan_floats(p, 3 * N);
    l->scale = nn_plan_floats(p, 3 * N);
    l->quat = nn_plan_floats(p, 4 * N);
    l->opacity = nn_plan_floats(p, N);
    l->color = nn_plan_floats(p, 3 * N);
    l->branch = nn_plan_bytes(p, N);
    if (nn_plan_finish(p, err))
        return -1;
    l->set = (struct gaussians){
        .n = N, .channels = 3, .mean = l->mean, .scale = l->scale,
        .quat = l->quat, .opacity = l->opacity, .color = l->color,
        .branch = l->branch};
    return 0;
}

int lam_plan(struct lam *l, size_t N, enum nn_type type, struct error *err)
{
    const struct nn_options opt = {NN_INFER, type};
    const size_t side = l->config.backbone.image, size = l->config.size;
    struct nn_plan *p = &l->plan;

    if (dinov2_plan(&l->vit, 1, side, side, opt, err))
        return -1;
    nn_plan_release(p);
    nn_plan_init(p, opt);
    l->N = N;
    l->M = l->vit.grid_h * l->vit.grid_w;
    rescale_plan(&l->resize, p, RESCALE_AREA, 1, size, size, side, side, 3);
    attention_plan(&l->attention, p, 1, N + l->M, l->config.transformer_heads,
                   l->D / l->config.transformer_heads);
    l->attention.row = l->D;
    l->attention.part = (N + l->M) * l->D;
    lam_plan_layers(l);
    return lam_allocate(l, err);
}

void lam_release(struct lam *l)
{
    dinov2_release(&l->vit);
    nn_plan_release(&l->plan);
    free(l->block);
    memset(l, 0, sizeof *l);
}

/* ---- one source --------------------------------------------------------- */

/* l->features of the picture. */
static void lam_encode(struct lam *l, const float *rgb)
{
    const size_t E = l->config.backbone.embed, M = l->M;
    float *joined = l->wide, *one = l->wide + LAM_LEVELS * M * E;

    rescale_forward(l->picture, rgb, &l->resize);
    dinov2_forward(l->picture, &l->vit);
    for (size_t k = 0; k < LAM_LEVELS; k++) {
        const float *patches = dinov2_tokens(&l->vit, k) +
                               (l->vit.tokens - M) * E;

        conv_forward(one, patches, &l->project[k]);
        for (size_t i = 0; i < M; i++)
            memcpy(joined + (LAM_LEVELS * i + k) * E, one + i * E,
                   E * sizeof *one);
    }
    conv_forward(l->features, joined, &l->fuse);
}

/* A query of each point: sines of its coordinates in octaves, cosines, itself,
 * through a layer. */
static void lam_embed(struct lam *l, const float *points, float metre)
{
    for (size_t i = 0; i < l->N; i++) {
        float *row = l->wide + i * EMBEDDED;

        for (int c = 0; c < 3; c++) {
            const float x = points[3 * i + (size_t)c] / metre;

            for (int k = 0; k < OCTAVES; k++) {
                const double angle = M_PI * (double)(1 << k) * (double)x;

                row[c * OCTAVES + k] = (float)sin(angle);
                row[(3 + c) * OCTAVES + k] = (float)cos(angle);
            }
            row[6 * OCTAVES + c] = x;
        }
    }
    conv_forward(l->normed, l->wide, &l->embed);
    layer_norm_forward(l->x, NULL, l->normed, &l->embed_norm, l->N);
}

/* Both streams attend to both. */
static void lam_block_forward(struct lam *l, struct transformer stream[2])
{
    for (size_t k = 0; k < 2; k++) {
        const size_t first = k * l->N * l->D;   /* of the stream's rows */

        transformer_use(&stream[k], l->x + first, l->normed + first,
                        l->wide + first, l->wide + 4 * first);
        transformer_attend(&stream[k], l->attention.part);
    }
    attention_forward(l->normed, l->wide, &l->attention);
    for (size_t k = 0; k < 2; k++)
        transformer_feed(NULL, &stream[k]);
}

/* What a head's raw numbers stand for, of all points. */
static void lam_activate(struct lam *l, enum lam_head head, float metre)
{
    const size_t n = l->N * l->head[head].out;
    float *const to[LAM_HEADS] = {l->color, l->scale, l->offset, l->opacity,
                                  l->quat};
    float *out = to[head];

    for (size_t i = 0; i < n; i++)
        out[i] = head == LAM_SCALE ? metre * fminf(expf(l->raw[i]), SCALE_MAX)
               : head == LAM_ROTATION ? l->raw[i] : math_sigmoid(l->raw[i]);
    for (size_t i = 0; head == LAM_PLACE && i < n; i++)
        out[i] = metre * (out[i] - 0.5f) * REACH;
    for (size_t i = 0; head == LAM_ROTATION && i < n; i += 4) {
        float *q = out + i;
        const float length = sqrtf(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] +
                                   q[3] * q[3]);

        for (int k = 0; k < 4; k++)
            q[k] /= fmaxf(length, 1e-12f);
    }
}

void lam_bake(struct lam *l, const float *rgb, const float *points,
              float metre)
{
    const size_t N = l->N, hidden = l->config.dynamic_hidden;
    float *const step[LAM_DECODER + 1] = {l->normed, l->wide,
                                          l->wide + N * hidden,
                                          l->wide + 2 * N * hidden};

    lam_encode(l, rgb);
    lam_embed(l, points, metre);
    conv_forward(l->x + N * l->D, l->features, &l->condition);
    for (size_t i = 0; i < l->config.transformer_layers; i++)
        lam_block_forward(l, l->block[i]);
    layer_norm_forward(l->normed, NULL, l->x, &l->norm, N);
    for (int i = 0; i < LAM_DECODER; i++)
        conv_forward(step[i + 1], step[i], &l->mlp[i]);
    for (int k = 0; k < LAM_HEADS; k++) {
        conv_forward(l->raw, step[LAM_DECODER], &l->head[k]);
        lam_activate(l, (enum lam_head)k, metre);
    }
}
