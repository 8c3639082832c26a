/* GAGAvatar's backbone: tokens of DINOv2's last four blocks at four scales,
 * fused from coarse to fine (DPT, Ranftl et al. 2021). */
#include "lib/net/dino_base.h"

#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"
#include "lib/nn/image.h"

static const float mean[3] = { 0.485f, 0.456f, 0.406f };
static const float deviation[3] = { 0.229f, 0.224f, 0.225f };

/* A residual unit of C channels, conv1 and conv2 under `at`. */
static void dino_unit_init(struct residual_unit *u, struct params *ps,
                           const char *at, size_t C)
{
    char name[120];

    conv_init(&u->conv1, ps, nn_name(name, "%s.conv1", at), C, C, 3, 1, true);
    conv_init(&u->conv2, ps, nn_name(name, "%s.conv2", at), C, C, 3, 1, true);
    u->conv1.act = ACT_RELU;
    u->conv2.add = true;
    ps->tensor[u->conv2.weight].gain = 0.5f;
}

/* Level k: projection of the tokens, its change of scale, layer_rn. */
static void dino_level_init(struct dino_level *l, struct params *ps,
                            const char *prefix, size_t k, size_t embed,
                            size_t out)
{
    static const size_t times[DINO_LEVELS] = { 1, 2, 4, 4 };
    static const size_t factor[DINO_LEVELS] = { 4, 2, 1, 1 };
    char name[120];
    size_t C = times[k] * out;

    l->channels = C;
    l->factor = factor[k];
    conv_init(&l->project, ps, nn_name(name, "%sprojects.%zu", prefix, k),
              embed, C, 1, 1, true);
    l->project.no_din = true;
    nn_name(name, "%sresize_layers.%zu", prefix, k);
    if (l->factor > 1)
        deconv_init(&l->grow, ps, name, C, C, l->factor);
    else if (k == 3)
        conv_init(&l->shrink, ps, name, C, C, 3, 2, true);
    conv_init(&l->join, ps, nn_name(name, "%slayer_rn.%zu", prefix, k), C + 3,
              out, 3, 1, false);
    l->join.in_data = (C + 3 + 15) / 16 * 16;
}

int dino_base_init(struct dino_base *d, struct params *ps, const char *prefix,
                   const struct dinov2_config *vit, size_t out,
                   struct error *err)
{
    char name[120];

    memset(d, 0, sizeof *d);
    d->ps = ps;
    d->out = out;
    nn_name(name, "%sdino_model.", prefix);
    if (dinov2_init(&d->vit, ps, name, vit, true, err))
        return -1;
    if (vit->last != DINO_LEVELS)
        return error_set(err, EX_CONFIG, "the fusion head takes %d blocks, "
                         "not %zu", DINO_LEVELS, vit->last);
    for (size_t k = 0; k < DINO_LEVELS; k++)
        dino_level_init(&d->level[k], ps, prefix, k, vit->embed, out);
    for (size_t i = 0; i < DINO_LEVELS; i++) {
        struct dino_fusion *f = &d->fusion[i];

        nn_name(name, "%srefinenet.%zu.out_conv", prefix, i);
        conv_init(&f->out, ps, name, out, out, 1, 1, true);
        /* the first has a skip unit in the checkpoints that nothing uses */
        nn_name(name, "%srefinenet.%zu.resConfUnit1", prefix, i);
        dino_unit_init(&f->skip, ps, name, out);
        nn_name(name, "%srefinenet.%zu.resConfUnit2", prefix, i);
        dino_unit_init(&f->main, ps, name, out);
    }
    conv_init(&d->last, ps, nn_name(name, "%soutput_conv", prefix), out, out,
              3, 1, true);
    return 0;
}

/* ---- planning ------------------------------------------------------------ */

/* A unit on B maps (h,w,C). */
static void dino_unit_plan(struct residual_unit *u, struct nn_plan *p,
                           size_t B, size_t h, size_t w, size_t C)
{
    u->r = nn_plan_map(p, B * h * w * C);
    u->h = nn_plan_map(p, B * h * w * C);
    conv_plan(&u->conv1, p, B, h, w);
    conv_plan(&u->conv2, p, B, h, w);
    nn_plan_recycle(p, u->r);
    nn_plan_recycle(p, u->h);
}

/* Level k's maps at its own scale. */
static void dino_level_plan(struct dino_level *l, struct dino_base *d, size_t k)
{
    struct nn_plan *p = &d->plan;
    size_t B = d->batch, gh = d->vit.grid_h, gw = d->vit.grid_w;
    size_t C = l->channels, patches = B * gh * gw;

    l->h = k == 3 ? (gh + 1) / 2 : gh * l->factor;
    l->w = k == 3 ? (gw + 1) / 2 : gw * l->factor;
    size_t pixels = B * l->h * l->w;
    l->tokens = nn_plan_map(p, patches * d->vit.config.embed);
    l->p = nn_plan_map(p, patches * C);
    conv_plan(&l->project, p, B, gh, gw);
    nn_plan_recycle(p, l->tokens);
    l->f = k == 2 ? l->p : nn_plan_map(p, pixels * C);
    if (l->factor > 1) {
        l->shuffled = nn_plan_map(p, pixels * C);
        conv_plan(&l->grow, p, B, gh, gw);
        nn_plan_recycle(p, l->shuffled);
    } else if (k == 3) {
        conv_plan(&l->shrink, p, B, gh, gw);
    }
    l->image = nn_plan_map(p, pixels * 3);
    rescale_plan(&l->picture, p, RESCALE_ANTIALIAS, B, d->h, d->w, l->h, l->w,
                 3);
    l->cat = nn_plan_map(p, pixels * l->join.in_data);
    l->rn = nn_plan_map(p, pixels * d->out);
    conv_plan(&l->join, p, B, l->h, l->w);
    nn_plan_recycle(p, l->p);
    nn_plan_recycle(p, l->f == l->p ? NULL : l->f);
    nn_plan_recycle(p, l->image);
    nn_plan_recycle(p, l->cat);
}

/* Fusion i, from the coarsest level on. */
static void dino_fusion_plan(struct dino_base *d, size_t i)
{
    struct nn_plan *p = &d->plan;
    struct dino_fusion *f = &d->fusion[i];
    const struct dino_level *at = &d->level[3 - i];
    size_t B = d->batch, C = d->out;

    f->h = at->h;
    f->w = at->w;
    f->oh = i < 3 ? d->level[2 - i].h : 2 * at->h;
    f->ow = i < 3 ? d->level[2 - i].w : 2 * at->w;
    size_t n = B * f->h * f->w * C;
    f->y = nn_plan_map(p, n);
    if (i)
        dino_unit_plan(&f->skip, p, B, f->h, f->w, C);
    f->m = nn_plan_map(p, n);
    dino_unit_plan(&f->main, p, B, f->h, f->w, C);
    f->c = nn_plan_map(p, n);
    conv_plan(&f->out, p, B, f->h, f->w);
    rescale_plan(&f->grow, p, RESCALE_ALIGNED, B, f->h, f->w, f->oh, f->ow, C);
    f->o = nn_plan_map(p, B * f->oh * f->ow * C);
    nn_plan_recycle(p, f->y);
    nn_plan_recycle(p, f->m);
    nn_plan_recycle(p, f->c);
}

/* The five buffers of gradients, each as large as the largest map, of which
 * the caller knows one. */
static void dino_base_plan_gradients(struct dino_base *d, size_t max)
{
    for (size_t k = 0; k < DINO_LEVELS; k++) {
        const struct dino_level *l = &d->level[k];
        size_t n = d->batch * l->h * l->w * l->join.in_data;
        size_t up = d->batch * d->vit.grid_h * d->vit.grid_w * l->channels;

        max = n > max ? n : max;
        max = up > max ? up : max;
    }
    for (int i = 0; i < 5; i++)
        d->g[i] = nn_plan_floats(&d->plan, max);
}

int dino_base_plan(struct dino_base *d, size_t batch, size_t input_h,
                   size_t input_w, size_t h, size_t w, size_t size,
                   struct nn_options opt, struct error *err)
{
    struct nn_plan *p = &d->plan;
    struct nn_options frozen = { NN_INFER, opt.type };

    nn_plan_release(p);
    nn_plan_init(p, opt);
    d->batch = batch;
    d->h = h;
    d->w = w;
    d->size = size;
    if (dinov2_plan(&d->vit, batch, h, w, frozen, err))
        return -1;
    d->resize_in = input_h != h || input_w != w;
    if (d->resize_in)
        rescale_plan(&d->resized, p, RESCALE_BILINEAR, batch, input_h,
                     input_w, h, w, 3);
    d->picture = nn_plan_floats(p, batch * h * w * 3);
    for (size_t k = 0; k < DINO_LEVELS; k++)
        dino_level_plan(&d->level[k], d, k);
    for (size_t i = 0; i < DINO_LEVELS; i++)
        dino_fusion_plan(d, i);
    size_t oh = d->fusion[3].oh, ow = d->fusion[3].ow;
    size_t max = batch * oh * ow * d->out;
    d->resize_out = oh != size || ow != size;
    d->feature = nn_plan_map(p, max);
    conv_plan(&d->last, p, batch, oh, ow);
    if (d->resize_out)
        rescale_plan(&d->final, p, RESCALE_ALIGNED, batch, oh, ow, size, size,
                     d->out);
    if (nn_plan_backward(p))
        dino_base_plan_gradients(d, max);
    return nn_plan_finish(p, err);
}

void dino_base_release(struct dino_base *d)
{
    dinov2_release(&d->vit);
    nn_plan_release(&d->plan);
    memset(d, 0, sizeof *d);
}

/* ---- one pass ------------------------------------------------------------ */

/* y += conv2(relu(conv1(relu(x)))); y holds x, and what else is summed. */
static void dino_unit_forward(float *y, const float *x, size_t n,
                              struct residual_unit *u)
{
    act_forward(u->r, x, ACT_RELU, n);
    conv_forward(u->h, u->r, &u->conv1);
    conv_forward(y, u->h, &u->conv2);
}

/* The patch tokens of block k as a map at its scale, joined with the
 * picture. */
static void dino_level_forward(struct dino_level *l, struct dino_base *d,
                               size_t k)
{
    size_t B = d->batch, gh = d->vit.grid_h, gw = d->vit.grid_w;
    size_t E = d->vit.config.embed, N = gh * gw;
    const float *tokens = dinov2_tokens(&d->vit, k);

    for (size_t n = 0; n < B; n++)
        memcpy(l->tokens + n * N * E, tokens + (n * (N + 1) + 1) * E,
               N * E * sizeof *tokens);
    conv_forward(l->p, l->tokens, &l->project);
    if (l->factor > 1) {
        conv_forward(l->shuffled, l->p, &l->grow);
        depth_to_space(l->f, l->shuffled, B, gh, gw, l->channels, l->factor);
    } else if (k == 3) {
        conv_forward(l->f, l->p, &l->shrink);
    }
    rescale_forward(l->image, d->picture, &l->picture);
    concat_forward(l->cat, l->image, l->f, B * l->h * l->w, 3, l->channels,
                   l->join.in_data, 1);
    conv_forward(l->rn, l->cat, &l->join);
}

/* The map so far plus level 3 - i, refined and brought to the next scale. */
static void dino_fusion_forward(struct dino_base *d, size_t i)
{
    struct dino_fusion *f = &d->fusion[i];
    const float *rn = d->level[3 - i].rn;
    size_t n = d->batch * f->h * f->w * d->out;

    memcpy(f->y, rn, n * sizeof *rn);
    if (i) {
        image_add(f->y, d->fusion[i - 1].o, n);
        dino_unit_forward(f->y, rn, n, &f->skip);
    }
    memcpy(f->m, f->y, n * sizeof *rn);
    dino_unit_forward(f->m, f->y, n, &f->main);
    /* a 1x1 convolution and a bilinear resizing commute: small one first */
    conv_forward(f->c, f->m, &f->out);
    rescale_forward(f->o, f->c, &f->grow);
}

PARALLEL(dino_base_normalise_part, i, float *, x)
{
    for (size_t c = 0; c < 3; c++)
        x[3 * i + c] = (x[3 * i + c] - mean[c]) / deviation[c];
}

/* To the mean and deviation that DINOv2 was trained with. */
static void dino_base_normalise(float *x, size_t pixels)
{
    parallel_each(dino_base_normalise_part, pixels, 1, x);
}

void dino_base_forward(float *features, const float *rgb, struct dino_base *d)
{
    size_t pixels = d->batch * d->h * d->w;

    if (d->resize_in)
        rescale_forward(d->picture, rgb, &d->resized);
    else
        memcpy(d->picture, rgb, pixels * 3 * sizeof *rgb);
    dino_base_normalise(d->picture, pixels);
    dinov2_forward(d->picture, &d->vit);
    for (size_t k = 0; k < DINO_LEVELS; k++)
        dino_level_forward(&d->level[k], d, k);
    for (size_t i = 0; i < DINO_LEVELS; i++)
        dino_fusion_forward(d, i);
    conv_forward(d->resize_out ? d->feature : features, d->fusion[3].o,
                 &d->last);
    if (d->resize_out)
        rescale_forward(features, d->feature, &d->final);
}

const float *dino_base_stage(size_t s[4], const struct dino_base *d,
                             enum dino_stage stage, size_t k)
{
    const struct dino_level *l = &d->level[k];
    const struct dino_fusion *f = &d->fusion[stage == DINO_FEATURE ? 3 : k];
    bool early = stage == DINO_CAT || stage == DINO_RN;

    s[0] = d->batch;
    s[1] = early ? l->h : f->oh;
    s[2] = early ? l->w : f->ow;
    s[3] = stage == DINO_CAT ? l->join.in_data : d->out;
    return stage == DINO_CAT ? l->cat : stage == DINO_RN ? l->rn
         : stage == DINO_REFINE ? f->o : d->feature;
}

/* ---- and back ------------------------------------------------------------ */

/* In the forward pass: y = ... + x + conv2(relu(conv1(relu(x)))).
 * dx (holding dy on entry) += the inner way's part; a, b are scratch. */
static void dino_unit_backward(float *dx, float *dy, float *a, float *b,
                               size_t n, struct residual_unit *u)
{
    conv_backward(a, dy, NULL, u->h, &u->conv2);
    conv_backward(b, a, u->h, u->r, &u->conv1);
    act_backward_out(b, b, u->r, ACT_RELU, n);
    image_add(dx, b, n);
}

/* g0: gradient of rn; g1, g2 scratch. */
static void dino_level_backward(struct dino_level *l, struct dino_base *d,
                                size_t k, float *g0, float *g1, float *g2)
{
    size_t B = d->batch, gh = d->vit.grid_h, gw = d->vit.grid_w;

    conv_backward(g1, g0, l->rn, l->cat, &l->join);
    concat_take(g2, g1, B * l->h * l->w, 3, l->channels, l->join.in_data);
    if (l->factor > 1) {
        space_to_depth(g1, g2, B, gh * l->factor, gw * l->factor,
                       l->channels, l->factor);
        conv_backward(g2, g1, l->shuffled, l->p, &l->grow);
    } else if (k == 3) {
        conv_backward(g1, g2, l->f, l->p, &l->shrink);
        memcpy(g2, g1, B * gh * gw * l->channels * sizeof *g2);
    }
    conv_backward(NULL, g2, l->p, l->tokens, &l->project);
}

void dino_base_backward(const float *dfeatures, struct dino_base *d)
{
    float **g = d->g;
    size_t n = d->batch * d->fusion[3].oh * d->fusion[3].ow * d->out;

    if (d->resize_out)
        rescale_backward(g[0], dfeatures, &d->final);
    else
        memcpy(g[0], dfeatures, n * sizeof *dfeatures);
    conv_backward(g[1], g[0], NULL, d->fusion[3].o, &d->last);
    for (size_t i = DINO_LEVELS; i-- > 0;) {
        struct dino_fusion *f = &d->fusion[i];

        n = d->batch * f->h * f->w * d->out;
        rescale_backward(g[0], g[1], &f->grow);            /* dc */
        conv_backward(g[1], g[0], NULL, f->m, &f->out);   /* dm */
        memcpy(g[0], g[1], n * sizeof *g[0]);
        dino_unit_backward(g[0], g[1], g[2], g[3], n, &f->main);   /* g0: dy */
        memcpy(g[1], g[0], n * sizeof *g[0]);             /* dprev */
        if (i)
            dino_unit_backward(g[0], g[1], g[2], g[3], n, &f->skip);
        dino_level_backward(&d->level[3 - i], d, 3 - i, g[0], g[2], g[3]);
    }
}
