/* GAGAvatar's backbone: tokens of DINOv2's last four blocks at four scales,
 * fused from coarse to fine (DPT, Ranftl et al. 2021). */
#include "lib/net/dino_base.h"

#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"

static const float mean[3] = { 0.485f, 0.456f, 0.406f };
static const float deviation[3] = { 0.229f, 0.224f, 0.225f };

/* ---- its own steps: the transformer, and what it gives ------------------- */

PARALLEL(dino_normalise_part, i, float *, y, const float *, x)
{
    for (size_t c = 0; c < 3; c++)
        y[3 * i + c] = (x[3 * i + c] - mean[c]) / deviation[c];
}

/* The picture, to the mean and deviation that DINOv2 was trained with; and the
 * transformer's pass on it. */
static void dino_see(struct tape_step *s)
{
    struct dinov2 **vit = s->layer;

    parallel_each(dino_normalise_part, s->batch * s->h * s->w, 1, s->out,
                  s->of[0]->x);
    dinov2_forward(s->x, *vit);
}

static const struct tape_op see_op = {
    sizeof(struct dinov2 *), 1, false, NULL, dino_see, NULL, NULL
};

struct dino_tokens {
    struct dinov2 *vit;
    size_t k;                     /* of which block */
};

static void dino_tokens_plan(struct tape_step *s, struct nn_plan *p)
{
    const struct dino_tokens *l = s->layer;

    (void)p;
    s->h = l->vit->grid_h;
    s->w = l->vit->grid_w;
}

/* Of the patches, as a map. */
static void dino_tokens(struct tape_step *s)
{
    const struct dino_tokens *l = s->layer;
    const float *tokens = dinov2_tokens(l->vit, l->k);
    const size_t E = s->channels, N = s->h * s->w;

    for (size_t n = 0; n < s->batch; n++)
        memcpy(s->out + n * N * E, tokens + (n * (N + 1) + 1) * E,
               N * E * sizeof *tokens);
}

static const struct tape_op tokens_op = {
    sizeof(struct dino_tokens), 0, false, dino_tokens_plan, dino_tokens, NULL,
    NULL
};

/* ---- the network --------------------------------------------------------- */

/* That map of constants has so many channels, and is constant too. */
static int dino_given(struct tape *t, int map, size_t channels)
{
    t->map[map]->channels = channels;
    t->map[map]->constant = true;
    return map;
}

/* Level k, of `out` channels: the patch tokens of a block, projected, at its
 * scale of h x w pixels, joined with the picture. */
static void dino_level(struct dino_base *d, int picture, const char *prefix,
                       size_t k, size_t h, size_t w, size_t out)
{
    static const size_t times[DINO_LEVELS] = { 1, 2, 4, 4 };
    static const size_t factor[DINO_LEVELS] = { 4, 2, 1, 1 };
    const size_t C = times[k] * out;
    struct tape *t = &d->tape;
    struct conv c;
    char name[120];
    int x = TAPE_STEP(t, &tokens_op, picture);

    *(struct dino_tokens *)t->map[x]->layer = (struct dino_tokens){&d->vit, k};
    dino_given(t, x, d->vit.config.embed);
    x = tape_conv(t, x, nn_name(name, "%sprojects.%zu", prefix, k), C, 1, true);
    nn_name(name, "%sresize_layers.%zu", prefix, k);
    if (factor[k] > 1) {
        deconv_init(&c, t->ps, name, C, C, factor[k]);
        x = tape_to_space(t, tape_declared(t, x, &c), factor[k]);
    } else if (k == 3) {
        conv_init(&c, t->ps, name, C, C, 3, 2, true);
        x = tape_declared(t, x, &c);
    }
    picture = tape_rescale(t, picture, RESCALE_ANTIALIAS, h, w);
    x = tape_concat(t, dino_given(t, picture, 3), x);
    nn_name(name, "%slayer_rn.%zu", prefix, k);
    d->cat[k] = x;
    d->rn[k] = tape_conv(t, x, name, out, 3, false);
    tape_layer(t, d->rn[k])->in_data = (C + 3 + 15) / 16 * 16;
    t->map[x]->channels = (C + 3 + 15) / 16 * 16;
}

/* y + conv2(relu(conv1(relu(x)))), the two under `at`. */
static int dino_unit(struct tape *t, int y, int x, const char *at)
{
    const size_t C = tape_channels(t, x);
    char name[120];

    x = tape_act(t, x, ACT_RELU);
    x = tape_conv(t, x, nn_name(name, "%s.conv1", at), C, 3, true);
    tape_layer(t, x)->act = ACT_RELU;
    y = tape_conv_onto(t, y, x, nn_name(name, "%s.conv2", at), C, 3, true);
    t->ps->tensor[tape_layer(t, y)->weight].gain = 0.5f;
    return y;
}

/* Fusion i, from the coarsest level on: x, what is there so far, plus level
 * 3 - i, refined and brought to h x w pixels, the next scale. */
static int dino_fusion(struct dino_base *d, int x, const char *prefix, size_t i,
                       size_t h, size_t w)
{
    struct tape *t = &d->tape, unused;
    const int rn = d->rn[3 - i];
    const size_t C = tape_channels(t, rn);
    struct conv out;
    char name[120];

    nn_name(name, "%srefinenet.%zu.out_conv", prefix, i);
    conv_init(&out, t->ps, name, C, C, 1, 1, true);
    nn_name(name, "%srefinenet.%zu.resConfUnit1", prefix, i);
    if (i) {
        x = dino_unit(t, tape_add(t, rn, x, ACT_NONE), rn, name);
    } else {            /* the checkpoints have one that nothing uses */
        tape_init(&unused, t->ps, C, false);
        dino_unit(&unused, 0, 0, name);
        tape_release(&unused);
        x = rn;
    }
    nn_name(name, "%srefinenet.%zu.resConfUnit2", prefix, i);
    x = dino_unit(t, x, x, name);
    /* a 1x1 convolution and a bilinear resizing commute: small one first */
    return tape_rescale(t, tape_declared(t, x, &out), RESCALE_ALIGNED, h, w);
}

int dino_base_init(struct dino_base *d, struct params *ps, const char *prefix,
                   const struct dinov2_config *vit, size_t h, size_t w,
                   size_t size, size_t out, struct error *err)
{
    const size_t gh = h / vit->patch, gw = w / vit->patch;
    const size_t high[] = { 8 * gh, 4 * gh, 2 * gh, gh, (gh + 1) / 2 };
    const size_t wide[] = { 8 * gw, 4 * gw, 2 * gw, gw, (gw + 1) / 2 };
    struct tape *t = &d->tape;
    char name[120];

    memset(d, 0, sizeof *d);
    d->h = h;
    d->w = w;
    nn_name(name, "%sdino_model.", prefix);
    if (dinov2_init(&d->vit, ps, name, vit, true, err))
        return -1;
    if (vit->last != DINO_LEVELS)
        return error_set(err, EX_CONFIG, "the fusion head takes %d blocks, "
                         "not %zu", DINO_LEVELS, vit->last);
    tape_init(t, ps, 3, false);
    int x = tape_rescale(t, 0, RESCALE_BILINEAR, h, w);
    x = TAPE_STEP(t, &see_op, x);
    *(struct dinov2 **)t->map[x]->layer = &d->vit;
    tape_constant(t, x);
    for (size_t k = 0; k < DINO_LEVELS; k++)
        dino_level(d, x, prefix, k, high[k + 1], wide[k + 1], out);
    for (size_t i = 0; i < DINO_LEVELS; i++)
        d->refine[i] = x = dino_fusion(d, x, prefix, i, high[3 - i],
                                       wide[3 - i]);
    nn_name(name, "%soutput_conv", prefix);
    d->feature = tape_conv(t, x, name, out, 3, true);
    if (high[0] != size || wide[0] != size)
        tape_rescale(t, d->feature, RESCALE_ALIGNED, size, size);
    return 0;
}

int dino_base_plan(struct dino_base *d, size_t batch, size_t input_h,
                   size_t input_w, struct nn_options opt, struct error *err)
{
    const struct nn_options frozen = { NN_INFER, opt.type };

    return dinov2_plan(&d->vit, batch, d->h, d->w, frozen, err) ||
                   tape_plan(&d->tape, batch, input_h, input_w, opt, err)
               ? -1
               : 0;
}

void dino_base_release(struct dino_base *d)
{
    dinov2_release(&d->vit);
    tape_release(&d->tape);
    memset(d, 0, sizeof *d);
}
