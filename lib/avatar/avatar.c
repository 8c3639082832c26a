#include "lib/avatar/avatar.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/avatar/branches.h"
#include "lib/avatar/coverage.h"
#include "lib/avatar/light.h"
#include "lib/geom/camera.h"
#include "lib/model/model.h"

const float avatar_upright[9] = {1, 0, 0, 0, -1, 0, 0, 0, -1};

unsigned avatar_without_parse(const char *word)
{
    static const char *const words[] = {"dynamic", "static", "mouth",
                                        "interp", "deform", "bend"};

    for (unsigned i = 0; i < 6; i++)
        if (strcmp(word, words[i]) == 0)
            return 1u << i;
    return 0;
}

int avatar_without_list(unsigned *bits, const char *words, struct error *err)
{
    while (*words) {
        size_t n = strcspn(words, ",");
        char word[16];

        snprintf(word, sizeof word, "%.*s", (int)(n < 15 ? n : 15), words);
        unsigned bit = avatar_without_parse(word);
        if (!bit)
            return error_set(err, EX_USAGE, "unknown part \"%s\" (expected "
                             "dynamic, static, mouth, interp, deform or "
                             "bend)",
                             word);
        *bits |= bit;
        words += n + (words[n] == ',');
    }
    return 0;
}

/* ---- declaring --------------------------------------------------------- */

static int declare_decoders(struct avatar *a, struct error *err)
{
    const struct avatar_config *c = &a->config;
    struct gaussian_head head = {.colors = c->channels,
                                 .quirk_columns = c->public_quirks,
                                 .quirk_rotation = false};
    struct gaussian_head points = {.colors = c->channels,
                                   .quirk_rotation = c->public_quirks};
    size_t rows[2] = {a->head->V, c->vertex_width};

    head.position = GAUSSIAN_POSITION_DEPTH;
    if (conv_decoder_init(&a->static_decoder, a->ps, "static.",
                          static_inputs(c), c->static_width, head, err))
        return -1;
    head.position = GAUSSIAN_POSITION_OFFSET;
    if (conv_decoder_init(&a->mouth_decoder, a->ps, "mouth.",
                          mouth_inputs(c), c->mouth_width, head, err))
        return -1;
    points.position = GAUSSIAN_POSITION_NONE;
    a->head_base = params_add(a->ps, "dynamic.head_base", 2, rows,
                              PARAM_NORMAL, 0.1f);
    return mlp_decoder_init(&a->dynamic_decoder, a->ps, "dynamic.",
                            dynamic_inputs(c), c->dynamic_width,
                            c->dynamic_hidden, points, err);
}

int avatar_init(struct avatar *a, struct params *ps,
                const struct avatar_config *config, const struct head *head,
                struct error *err)
{
    memset(a, 0, sizeof *a);
    a->config = *config;
    a->head = head;
    a->ps = ps;
    if (model_check_head(config, head, err))
        return -1;
    if (head->nlip_inner == 0)
        return error_set(err, EX_CONFIG, "head has no inner lip ring "
                         "(expected the list lip_inner)");
    if (densify_init(&a->dense, head->f, head->F, head->V, err) ||
        mesh_weights(a, err) ||
        backbone_init(&a->backbone, ps, "backbone.", &config->backbone,
                      err) ||
        plane_init_init(&a->init, ps, "init.", config->feature + 1,
                        config->init_width, err) ||
        declare_decoders(a, err)) {
        avatar_release(a);
        return -1;
    }
    return 0;
}

/* ---- starting weights -------------------------------------------------- */

/* The named tensor times factor; nothing when there is no such tensor. */
static void scale_tensor(struct avatar *a, const char *name, float factor)
{
    size_t t = params_find(a->ps, name);

    if (t == (size_t)-1)
        return;
    float *w = param_w(a->ps, t);
    for (size_t i = 0; i < a->ps->tensor[t].count; i++)
        w[i] *= factor;
}

static void set_bias(struct avatar *a, const char *name, size_t first,
                     size_t n, float value)
{
    size_t t = params_find(a->ps, name);

    if (t == (size_t)-1 || first + n > a->ps->tensor[t].count)
        return;
    for (size_t i = first; i < first + n; i++)
        param_w(a->ps, t)[i] = value;
}

/* Without the shifts of rgb_skip a scale starts at 0.05 sigmoid(bias). */
static float scale_bias(const struct avatar *a, float spacing)
{
    return a->config.rgb_skip ? 0
                              : attribute_logit(0.6f * spacing /
                                                BRANCH_SCALE_MAX);
}

void avatar_start(struct avatar *a)
{
    const struct avatar_config *c = &a->config;
    size_t C = c->channels;
    const char *bias = "static.gaussian_conv.6.bias";

    scale_tensor(a, "static.gaussian_conv.6.weight", 0.1f);
    set_bias(a, bias, C, 1, 2.5f);
    set_bias(a, bias, C + 1, 3, scale_bias(a, 2.0f / (float)c->plane));
    set_bias(a, bias, C + 4, 1, 1);
    bias = "mouth.gaussian_conv.6.bias";
    scale_tensor(a, "mouth.gaussian_conv.6.weight", 0.1f);
    set_bias(a, bias, C, 1, 2.5f);
    set_bias(a, bias, C + 1, 3, scale_bias(a, 0.25f / (float)c->mouth));
    set_bias(a, bias, C + 4, 1, 1);
    if (!c->rgb_skip)
        set_bias(a, bias, C + 10, 1, -0.06f);   /* 12 mm behind the lips */
    scale_tensor(a, "dynamic.color_layers.2.weight", 0.1f);
    scale_tensor(a, "dynamic.opacity_layers.2.weight", 0.1f);
    scale_tensor(a, "dynamic.scale_layers.2.weight", 0.1f);
    scale_tensor(a, "dynamic.rotation_layers.2.weight", 0.1f);
    set_bias(a, "dynamic.opacity_layers.2.bias", 0, 1, 2.5f);
    set_bias(a, "dynamic.scale_layers.2.bias", 0, 3, scale_bias(a, 0.02f));
    set_bias(a, "dynamic.rotation_layers.2.bias", 0, 1, 1);
}

/* ---- planning ---------------------------------------------------------- */

struct slice {
    float **at;
    size_t n;
    int train;      /* only needed for the backward */
};

/* Hand out parts of one block; with block NULL only count. */
static size_t deal(const struct slice *slices, size_t count, int train,
                   float *block)
{
    size_t total = 0;

    for (size_t i = 0; i < count; i++) {
        if (slices[i].train && !train)
            continue;
        if (block)
            *slices[i].at = block + total;
        total += (slices[i].n + 15) / 16 * 16;
    }
    return total;
}

static int allocate(struct avatar *a, struct error *err)
{
    struct avatar_scratch *s = a->scratch;
    const struct avatar_config *c = &a->config;
    size_t n2 = s->n2, D = s->D, M = s->M, Cf = s->Cf, N = D + n2 + M;
    size_t si = static_inputs(c), di = dynamic_inputs(c);
    size_t mi = mouth_inputs(c), C = c->channels;
    const struct slice slices[] = {
        {&s->rgb, 3 * s->S * s->S, 0}, {&s->rgba, 4 * s->S * s->S, 0},
        {(float **)&s->bled, s->S * s->S / 4 + 1, 0},
        {&s->features, n2 * Cf, 0}, {&s->dfeatures, n2 * Cf, 1},
        {&s->coverage, n2, 0}, {&s->zbuffer, n2, 0}, {&s->held, n2, 0},
        {&s->cover, n2, 0},
        {&s->bent, 3 * s->V, 0}, {&s->bend, N, 0}, {&s->driven, 3 * D, 0},
        {&s->ddriven, 3 * D, 1},
        {&s->raster, coverage_scratch(s->n) / sizeof(float) + 1, 0},
        {&s->init_in, n2 * (Cf + 1), 0}, {&s->dinit_in, n2 * (Cf + 1), 1},
        {&s->delta, 2 * n2, 0}, {&s->U, 2 * n2, 0}, {&s->dU, 2 * n2, 1},
        {&s->sample, 4 * n2, 0}, {&s->dsample, 4 * n2, 1},
        {&s->dmatte, n2, 1},
        {&s->static_in, n2 * si, 0}, {&s->dstatic_in, n2 * si, 1},
        {&s->resampled, n2 * Cf, 0},
        {&s->static_logit, 3 * n2, 0}, {&s->dstatic_logit, 3 * n2, 1},
        {&s->surface, n2, 0}, {&s->p, n2, 0}, {&s->dp, n2, 1},
        {&s->dense, 3 * D, 0}, {&s->ndc, 2 * D, 0},
        {&s->normals, 3 * s->V, 0}, {&s->dense_normals, 3 * D, 0},
        {&s->seen, D, 0}, {&s->spacing, D, 0}, {&s->dsampled, D * Cf, 0},
        {&s->dpicture, 4 * D, 0}, {&s->h, D * c->vertex_width, 0},
        {&s->dynamic_in, D * di, 0}, {&s->ddynamic_in, D * di, 1},
        {&s->dynamic_logit, 3 * D, 0}, {&s->weight, D, 0},
        {&s->tmp, 7 * s->V, 0}, {(float **)&s->level, s->V, 0},
        {&s->sheet, 3 * M, 0}, {&s->uv, 2 * M, 0},
        {&s->mouth_ndc, 2 * M, 0}, {&s->mouth_sample, M * Cf, 0},
        {&s->mouth_picture, 4 * M, 0}, {&s->mouth_in, M * mi, 0},
        {&s->dmouth_in, M * mi, 1}, {&s->mouth_logit, 3 * M, 0},
        {&s->q, 3 * M, 0}, {&s->dq, 3 * M, 1},
        {&s->mean, 3 * N, 0}, {&s->scale, 3 * N, 0}, {&s->quat, 4 * N, 0},
        {&s->opacity, N, 0}, {&s->color, C * N, 0},
        {&s->opacity_raw, N, 0}, {&s->scale_raw, 3 * N, 0},
        {&s->p_raw, n2, 0}, {&s->opacity_shift, N, 0},
        {&s->scale_shift, N, 0}, {&s->p_shift, n2, 0}, {&s->matte, N, 0},
        {&s->dmean, 3 * N, 1}, {&s->dscale, 3 * N, 1},
        {&s->dquat, 4 * N, 1}, {&s->dopacity, N, 1}, {&s->dcolor, C * N, 1},
        {&s->frame_dmean, 3 * N, 1}, {(float **)&s->branch, N / 4 + 1, 0}
    };
    size_t count = sizeof slices / sizeof *slices;
    size_t bytes = deal(slices, count, s->train, NULL) * sizeof(float);

    s->block = aligned_alloc(64, bytes ? bytes : 64);
    if (!s->block)
        return error_set(err, EX_OSERR, "no memory for an avatar (%zu MB)",
                         bytes >> 20);
    memset(s->block, 0, bytes);
    deal(slices, count, s->train, s->block);
    return 0;
}

static int plan_networks(struct avatar *a, struct nn_options opt,
                         struct error *err)
{
    const struct avatar_scratch *s = a->scratch;
    size_t points = a->without & WITHOUT_INTERP ? s->V : s->D;

    if (backbone_plan(&a->backbone, 1, s->S, opt, err) ||
        plane_init_plan(&a->init, 1, s->n, s->n, opt, err) ||
        conv_decoder_plan(&a->static_decoder, 1, s->n, s->n, opt, err) ||
        mlp_decoder_plan(&a->dynamic_decoder, 1, points, opt, err) ||
        conv_decoder_plan(&a->mouth_decoder, 1, s->K, s->K, opt, err))
        return -1;
    return 0;
}

static void scratch_free(struct avatar *a)
{
    if (a->scratch)
        free(a->scratch->block);
    free(a->scratch);
    a->scratch = NULL;
}

int avatar_plan(struct avatar *a, struct nn_options opt, struct error *err)
{
    const struct avatar_config *c = &a->config;

    scratch_free(a);
    struct avatar_scratch *s = a->scratch = calloc(1, sizeof *s);
    if (!s)
        return error_set(err, EX_OSERR, "no memory for an avatar");
    s->opt = opt;
    s->train = opt.mode != NN_INFER;
    s->S = c->size;
    s->n = c->plane;
    s->n2 = s->n * s->n;
    s->K = c->mouth;
    s->M = s->K * s->K;
    s->Cf = c->feature;
    s->V = a->head->V;
    s->D = a->dense.V + a->dense.E;
    return allocate(a, err) || plan_networks(a, opt, err) ? -1 : 0;
}

void avatar_update(struct avatar *a)
{
    backbone_update(&a->backbone);
    plane_init_update(&a->init);
    conv_decoder_update(&a->static_decoder);
    conv_decoder_update(&a->mouth_decoder);
    mlp_decoder_update(&a->dynamic_decoder);
}

void avatar_release(struct avatar *a)
{
    scratch_free(a);
    free(a->neck);
    free(a->moving);
    free(a->lining);
    densify_release(&a->dense);
    backbone_release(&a->backbone);
    plane_init_release(&a->init);
    conv_decoder_release(&a->static_decoder);
    conv_decoder_release(&a->mouth_decoder);
    mlp_decoder_release(&a->dynamic_decoder);
    memset(a, 0, sizeof *a);
}

#define BLEED 12    /* pixels that colours run on over the matte's edge */

/* ---- Phase A ----------------------------------------------------------- */

static void count_gaussians(struct avatar *a)
{
    const struct avatar_scratch *s = a->scratch;
    unsigned w = a->without;
    size_t n[BRANCH_COUNT] = {
        w & WITHOUT_DYNAMIC ? 0 : w & WITHOUT_INTERP ? s->V : s->D,
        w & WITHOUT_STATIC ? 0 : s->n2, w & WITHOUT_MOUTH ? 0 : s->M
    };

    a->first[0] = 0;
    for (int b = 0; b < BRANCH_COUNT; b++) {
        a->first[b + 1] = a->first[b] + n[b];
        memset(s->branch + a->first[b], b, n[b]);
    }
}

/* Whether pixel i and all within two pixels are the person's: lenses and
 * codecs smear colours over the edge. */
static uint8_t wholly(const float *rgba, size_t S, size_t i)
{
    for (int k = 0; k < 25; k++) {
        long y = (long)(i / S) + k / 5 - 2, x = (long)(i % S) + k % 5 - 2;

        if (y < 0 || x < 0 || y >= (long)S || x >= (long)S)
            continue;
        if (rgba[4 * ((size_t)y * S + (size_t)x) + 3] <= 0.95f)
            return 0;
    }
    return 1;
}

/* One step of colours outwards over the matte's edge: a pixel that is not
 * wholly the person's takes the mean of its neighbours that are, or became so
 * in an earlier step.  done (S,S) is the step a pixel got its colour in. */
static void bleed_step(float *rgba, uint8_t *done, size_t S, uint8_t step)
{
    for (size_t i = 0; i < S * S; i++) {
        float sum[3] = {0}, n = 0;

        if (done[i])
            continue;
        for (int k = 0; k < 9; k++) {
            long y = (long)(i / S) + k / 3 - 1, x = (long)(i % S) + k % 3 - 1;

            if (y < 0 || x < 0 || y >= (long)S || x >= (long)S)
                continue;
            size_t j = (size_t)y * S + (size_t)x;
            if (!done[j] || done[j] > step)
                continue;
            for (size_t c = 0; c < 3; c++)
                sum[c] += rgba[4 * j + c];
            n++;
        }
        if (n == 0)
            continue;
        for (size_t c = 0; c < 3; c++)
            rgba[4 * i + c] = sum[c] / n;
        done[i] = (uint8_t)(step + 1);
    }
}

/* The picture as floats: over black for the backbone, and with its matte,
 * the person's colours running on beyond the edge so that no background is
 * sampled there. */
static void take_picture(struct avatar *a, const struct avatar_source *src)
{
    struct avatar_scratch *s = a->scratch;

    for (size_t i = 0; i < s->S * s->S; i++) {
        float m = src->matte ? (float)src->matte[i] / 255 : 1;

        for (size_t c = 0; c < 3; c++) {
            float x = (float)src->rgb[3 * i + c] / 255;

            s->rgba[4 * i + c] = x;
            s->rgb[3 * i + c] = m * x;
        }
        s->rgba[4 * i + 3] = m;
    }
    for (size_t i = 0; i < s->S * s->S; i++)
        s->bled[i] = wholly(s->rgba, s->S, i);
    for (uint8_t step = 1; step <= BLEED && a->config.rgb_skip; step++)
        bleed_step(s->rgba, s->bled, s->S, step);
}

/* R_s: what takes the source's shoulders to the camera's axes. */
static void source_rotation(float from[9], const struct avatar *a)
{
    for (int i = 0; i < 9; i++)
        from[i] = a->scratch->cam[4 * (i / 3) + i % 3];
}

/* The shoulders' motion since the source, in the frame of a head seen by
 * cam. */
static void shoulders_since(float body[12], const struct avatar *a,
                            const float cam[12])
{
    float from[9];

    source_rotation(from, a);
    bend_body(body, a->bend.pivot, from, cam);
}

/* The source's mesh as its neck bends, and the mesh's weights. */
static void start_bending(struct avatar *a, const float *verts)
{
    struct avatar_scratch *s = a->scratch;
    size_t dynamic = a->first[BRANCH_STATIC], n = a->first[BRANCH_COUNT];
    float body[12];

    memset(s->bend, 0, n * sizeof *s->bend);
    memcpy(s->bent, verts, 3 * s->V * sizeof *s->bent);
    if (a->without & WITHOUT_BEND)
        return;
    memcpy(s->bend, a->neck, dynamic * sizeof *s->bend);
    bend_body(body, a->bend.pivot, avatar_upright, s->cam);
    bend_points(s->bent, verts, a->neck, s->V, body);
}

/* From what the dynamic branch has seen. */
static void fit_light(struct avatar *a)
{
    struct avatar_scratch *s = a->scratch;

    memset(a->light, 0, sizeof a->light);
    if (a->config.rgb_skip && a->first[BRANCH_STATIC])
        light_fit(a->light, s->dpicture, s->normals, s->weight, s->V,
                  s->tmp);
}

void avatar_bake(struct avatar *a, const struct avatar_source *src)
{
    struct avatar_scratch *s = a->scratch;
    const struct head *h = a->head;

    count_gaussians(a);
    memcpy(s->cam, src->cam, sizeof s->cam);
    static_normal(a->normal, src->cam);
    take_picture(a, src);
    backbone_forward(s->features, s->rgb, &a->backbone);
    start_bending(a, src->verts);
    coverage_map(s->coverage, s->bent, h->V, h->f, h->F, src->cam, s->n,
                 s->raster);
    coverage_depth(s->zbuffer, s->held, s->bent, a->moving, h->f, h->F,
                   src->cam, s->n);
    dynamic_bake(a, src->verts);
    static_bake(a);
    mouth_bake(a, src->verts);
    fit_light(a);
    a->set = (struct gaussians){
        .n = a->first[BRANCH_COUNT], .channels = (int)a->config.channels,
        .mean = s->mean, .scale = s->scale, .quat = s->quat,
        .opacity = s->opacity, .color = s->color, .branch = s->branch
    };
    if (!s->train)
        return;
    size_t n = a->set.n;
    memset(s->dmean, 0, 3 * n * sizeof *s->dmean);
    memset(s->dscale, 0, 3 * n * sizeof *s->dscale);
    memset(s->dquat, 0, 4 * n * sizeof *s->dquat);
    memset(s->dopacity, 0, n * sizeof *s->dopacity);
    memset(s->dcolor, 0, n * a->config.channels * sizeof *s->dcolor);
    memset(s->frame_dmean, 0, 3 * n * sizeof *s->frame_dmean);
}

void avatar_bake_backward(struct avatar *a)
{
    struct avatar_scratch *s = a->scratch;

    memset(s->dfeatures, 0, s->n2 * s->Cf * sizeof *s->dfeatures);
    mouth_bake_backward(a);
    static_bake_backward(a);
    dynamic_bake_backward(a);
    backbone_backward(s->dfeatures, &a->backbone);
}

/* ---- Phase B ----------------------------------------------------------- */

void avatar_drive(float *means, struct avatar *a, const float *verts,
                  const float cam[12])
{
    struct avatar_scratch *s = a->scratch;
    size_t at = a->first[BRANCH_STATIC], mouth = a->first[BRANCH_MOUTH];
    size_t V = a->head->V;
    float lip[3], body[12];

    memcpy(s->frame_cam, cam, sizeof s->frame_cam);
    if (at == V)
        memcpy(s->driven, verts, 3 * V * sizeof *s->driven);
    else if (at)
        densify_forward(s->driven, verts, &a->dense, 3);
    bend_body(body, a->bend.pivot, avatar_upright, cam);
    bend_points(means, s->driven, s->bend, at, body);
    shoulders_since(body, a, cam);
    bend_points(means + 3 * at, a->set.mean + 3 * at, s->bend + at,
                mouth - at, body);
    /* mu = g - l_s + l_d + q */
    head_lip_centroid(lip, a->head, verts);
    for (size_t k = mouth; k < a->first[BRANCH_COUNT]; k++)
        for (size_t c = 0; c < 3; c++)
            means[3 * k + c] = a->set.mean[3 * k + c] + lip[c] -
                               a->mouth.centre[c];
}

void avatar_turn(float turn[TURN_COUNT], const struct avatar *a,
                 const float cam[12])
{
    float from[9];

    source_rotation(from, a);
    turn_since(turn, from, a->light, cam);
}

void avatar_turn_backward(float dcam[12], const float dturn[TURN_COUNT],
                          const struct avatar *a)
{
    float from[9];

    source_rotation(from, a);
    turn_since_backward(dcam, dturn, from, a->light);
}

int avatar_mouth_hidden(const struct avatar *a, const float *verts, float gap)
{
    struct head_mouth m;

    head_mouth(&m, a->head, verts);
    return m.gap < gap;
}

struct splat_gradients avatar_gradients(struct avatar *a)
{
    struct avatar_scratch *s = a->scratch;

    return (struct splat_gradients){
        .mean = s->frame_dmean, .scale = s->dscale, .quat = s->dquat,
        .opacity = s->dopacity, .color = s->dcolor
    };
}

void avatar_drive_backward(float *dverts, float dcam[12], struct avatar *a)
{
    struct avatar_scratch *s = a->scratch;
    size_t at = a->first[BRANCH_STATIC], mouth = a->first[BRANCH_MOUTH];
    size_t n = a->first[BRANCH_COUNT];
    float dlip[3] = {0}, from[9];

    memset(s->ddriven, 0, 3 * s->D * sizeof *s->ddriven);
    bend_points_backward(s->ddriven, dcam, s->frame_dmean, s->driven, s->bend,
                         at, a->bend.pivot, avatar_upright, s->frame_cam);
    if (at == a->head->V)
        for (size_t i = 0; i < 3 * at; i++)
            dverts[i] += s->ddriven[i];
    else if (at)
        densify_backward(dverts, s->ddriven, &a->dense, 3);
    source_rotation(from, a);
    bend_points_backward(s->dmean + 3 * at, dcam, s->frame_dmean + 3 * at,
                         a->set.mean + 3 * at, s->bend + at, mouth - at,
                         a->bend.pivot, from, s->frame_cam);
    for (size_t k = mouth; k < n; k++)
        for (size_t c = 0; c < 3; c++)
            dlip[c] += s->frame_dmean[3 * k + c];
    head_lip_centroid_backward(dverts, dlip, a->head);
    for (size_t i = 3 * mouth; i < 3 * n; i++)
        s->dmean[i] += s->frame_dmean[i];
    memset(s->frame_dmean, 0, 3 * n * sizeof *s->frame_dmean);
}
