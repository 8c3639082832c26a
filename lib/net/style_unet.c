/* StyleUNet (GAGAvatar's upsampler) as steps of a tape, after those that it
 * alone has. */
#include "lib/net/style_unet.h"

#include <math.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"
#include "lib/nn/style.h"

#define EPS 1e-8
#define CHUNK 16384              /* values that a thread takes at once */

/* ---- its own steps: x scale + shift ------------------------------------------ */

/* y = a b (+ c, or NULL), maps of n values. */
PARALLEL(style_unet_product_part, k, float *, y, const float *, a,
         const float *, b, const float *, c, size_t, n)
{
    const size_t end = (k + 1) * CHUNK < n ? (k + 1) * CHUNK : n;

    if (c) {
#pragma omp simd
        for (size_t i = k * CHUNK; i < end; i++)
            y[i] = a[i] * b[i] + c[i];
        return;
    }
#pragma omp simd
    for (size_t i = k * CHUNK; i < end; i++)
        y[i] = a[i] * b[i];
}

static void style_unet_product(float *y, const float *a, const float *b,
                               const float *c, size_t n)
{
    parallel_each(style_unet_product_part, (n + CHUNK - 1) / CHUNK, 1, y, a, b,
                  c, n);
}

static void style_unet_transform(struct tape_step *s)
{
    style_unet_product(s->out, s->of[0]->x, s->of[1]->x, s->of[2]->x,
                       tape_count(s));
}

static void style_unet_transform_backward(float *to, struct tape_step *s, int k)
{
    if (k == 2)
        memcpy(to, s->d, tape_count(s) * sizeof *to);
    else
        style_unet_product(to, s->d, s->of[1 - k]->x, NULL, tape_count(s));
}

static const struct tape_op transform_op = {
    0, 1, false, NULL, style_unet_transform, style_unet_transform_backward, NULL
};

/* ---- x rsqrt(mean(x^2) + eps), each row -------------------------------------- */

static void style_unet_unit(struct tape_step *s)
{
    const size_t Z = s->channels;

    for (size_t n = 0; n < s->batch; n++) {
        const float *x = s->of[0]->x + n * Z;
        double sum = 0;

        for (size_t i = 0; i < Z; i++)
            sum += (double)x[i] * (double)x[i];
        const double unit = 1 / sqrt(sum / (double)Z + EPS);
        for (size_t i = 0; i < Z; i++)
            s->out[n * Z + i] = (float)((double)x[i] * unit);
    }
}

static void style_unet_unit_backward(float *to, struct tape_step *s, int k)
{
    const size_t Z = s->channels;

    for (size_t n = 0; n < s->batch; n++, to += Z) {
        const float *x = s->of[k]->x + n * Z, *d = s->d + n * Z;
        double sum = 0, along = 0;

        for (size_t i = 0; i < Z; i++) {
            sum += (double)x[i] * (double)x[i];
            along += (double)x[i] * (double)d[i];
        }
        const double m = sum / (double)Z + EPS, unit = 1 / sqrt(m);
        for (size_t i = 0; i < Z; i++)
            to[i] = (float)(unit * ((double)d[i] - (double)x[i] * along /
                                                       (m * (double)Z)));
    }
}

static const struct tape_op unit_op = {
    0, 0, false, NULL, style_unet_unit, style_unet_unit_backward, NULL
};

/* ---- 4x4 pixels that are learned ---------------------------------------------- */

struct style_constant {
    struct params *ps;
    size_t tensor;              /* (1,C,4,4) */
};

static void style_unet_constant_plan(struct tape_step *s, struct nn_plan *p)
{
    (void)p;
    s->h = s->w = 4;
}

static void style_unet_constant(struct tape_step *s)
{
    const struct style_constant *l = s->layer;
    const float *w = param_w(l->ps, l->tensor);
    const size_t C = s->channels;

    for (size_t i = 0; i < tape_count(s); i++)
        s->out[i] = w[i % C * 16 + i / C % 16];
}

static void style_unet_constant_backward(float *to, struct tape_step *s, int k)
{
    const struct style_constant *l = s->layer;
    float *g = param_g(l->ps, l->tensor);
    const size_t C = s->channels;

    (void)to;
    (void)k;
    for (size_t i = 0; i < tape_count(s); i++)
        g[i % C * 16 + i / C % 16] += s->d[i];
}

static const struct tape_op constant_op = {
    sizeof(struct style_constant), 0, true, style_unet_constant_plan,
    style_unet_constant, style_unet_constant_backward, NULL
};

/* ---- the network --------------------------------------------------------------- */

/* Channels of the encoder at a side; the decoder has twice as many. */
static size_t style_unet_width(const struct style_unet *s, size_t side)
{
    size_t full = side <= 32 ? 256 : 8192 / side;
    size_t n = (size_t)((float)full * s->multiplier + 0.5f);

    return n < 8 ? 8 : (n + 7) / 8 * 8;
}

/* A convolution or linear layer with leaky ReLU and the gain that goes with
 * it. */
static int style_unet_lrelu(struct tape *t, int map)
{
    struct conv *c = tape_layer(t, map);

    c->act = ACT_LRELU;
    t->ps->tensor[c->weight].gain = ACT_LRELU_GAIN;
    return map;
}

/* h = lrelu(conv1 x), resized to side; lrelu(conv2 h) + skip(x resized). */
static int style_unet_residual(struct tape *t, int x, const char *at,
                               size_t out, size_t side, bool up)
{
    char name[120];
    int h = tape_conv(t, x, nn_name(name, "%s.conv1", at), tape_channels(t, x),
                      3, true);

    h = tape_rescale(t, style_unet_lrelu(t, h), RESCALE_BILINEAR, side, side);
    h = style_unet_lrelu(t, tape_conv(t, h, nn_name(name, "%s.conv2", at), out,
                                      3, true));
    nn_name(name, "%s.skip", at);
    if (up) {                     /* the 1x1 is cheaper before enlarging */
        x = tape_conv(t, x, name, out, 1, false);
        x = tape_rescale(t, x, RESCALE_BILINEAR, side, side);
    } else {
        x = tape_rescale(t, x, RESCALE_BILINEAR, side, side);
        x = tape_conv(t, x, name, out, 1, false);
    }
    return tape_add(t, h, x, ACT_NONE);
}

/* Two convolutions that make a scale (bias 1) or a shift (bias 0). */
static int style_unet_condition(struct tape *t, int x, const char *at,
                                float bias)
{
    const size_t C = tape_channels(t, x);
    char name[120];

    x = style_unet_lrelu(t, tape_conv(t, x, nn_name(name, "%s.0", at), C, 3,
                                      true));
    x = tape_conv(t, x, nn_name(name, "%s.2", at), 2 * C, 3, true);
    const struct conv *c = tape_layer(t, x);
    t->ps->tensor[c->weight].gain = 0.3f;
    t->ps->tensor[c->bias].init = PARAM_CONSTANT;
    t->ps->tensor[c->bias].gain = bias;
    return x;
}

/* The way down, to the innermost map. */
static int style_unet_encoder(struct style_unet *s, const char *prefix)
{
    const bool halve = s->in_size > s->out_size;
    const size_t top = halve ? s->in_size : s->out_size;
    struct tape *t = &s->tape;
    char name[120];
    int x = s->in_size < top
        ? tape_rescale(t, 0, RESCALE_BILINEAR, top, top) : 0;

    nn_name(name, "%sconv_body_first%s", prefix, halve ? ".0" : "");
    x = style_unet_lrelu(t, tape_conv(t, x, name, style_unet_width(s, top), 1,
                                      true));
    if (halve)
        x = style_unet_residual(t, x,
                                nn_name(name, "%sconv_body_first.1", prefix),
                                style_unet_width(s, s->out_size), s->out_size,
                                false);
    for (size_t i = 0; i < s->levels; i++) {
        const size_t side = s->out_size >> (i + 1);

        nn_name(name, "%sconv_body_down.%zu", prefix, i);
        x = s->level[i].down = style_unet_residual(
            t, x, name, style_unet_width(s, side), side, false);
    }
    nn_name(name, "%sfinal_conv", prefix);
    return style_unet_lrelu(t, tape_conv(t, x, name, tape_channels(t, x), 3,
                                         true));
}

/* The style's code of the innermost map, and what eight layers make of it. */
static void style_unet_style(struct style_unet *s, int inner,
                             const char *prefix)
{
    const size_t Z = 2 * style_unet_width(s, 4);
    struct tape *t = &s->tape;
    char name[120];
    int x = tape_flatten(t, inner, 16);

    nn_name(name, "%sfinal_linear", prefix);
    s->code = tape_keep(t, tape_linear(t, x, name, Z));
    x = TAPE_STEP(t, &unit_op, s->code);
    for (size_t i = 0; i < 8; i++) {
        nn_name(name, "%sstylegan_decoder.style_mlp.%zu", prefix, 2 * i + 1);
        x = style_unet_lrelu(t, tape_linear(t, x, name, Z));
    }
    s->latent = x;
}

/* Where the decoder begins. */
static int style_unet_start(struct style_unet *s, const char *prefix)
{
    const size_t C = 2 * style_unet_width(s, 4), dim[4] = {1, C, 4, 4};
    struct tape *t = &s->tape;
    char name[120];
    const int x = tape_step(t, &constant_op, NULL, 0);
    struct style_constant *l = t->map[x]->layer;

    nn_name(name, "%sstylegan_decoder.constant_input.weight", prefix);
    l->ps = t->ps;
    l->tensor = params_add(t->ps, name, 4, dim, PARAM_NORMAL, 1);
    t->map[x]->channels = C;
    return x;
}

/* One of StyleGAN2's convolutions. */
static int style_unet_convolve(struct style_unet *s, int x, const char *prefix,
                               const char *layer, size_t noise, size_t side,
                               bool up)
{
    char name[120], map[120];

    nn_name(name, "%sstylegan_decoder.%s", prefix, layer);
    nn_name(map, "%sstylegan_decoder.noises.noise%zu", prefix, noise);
    return style_conv(&s->tape, x, s->latent, name, map, side,
                      2 * style_unet_width(s, side), up);
}

/* One level up, from f, the way up's map, and x, the decoder's: conditions, two
 * style convolutions, the picture. */
static void style_unet_level(struct style_unet *s, size_t i, int f, int x,
                             int rgb, const char *prefix)
{
    struct style_level *l = &s->level[i];
    struct tape *t = &s->tape;
    const size_t side = 8u << i;
    char name[120];

    f = tape_add(t, f, s->level[s->levels - 1 - i].down, ACT_NONE);
    l->up = style_unet_residual(
        t, f, nn_name(name, "%sconv_body_up.%zu", prefix, i),
        style_unet_width(s, side), side, true);
    const int scale = style_unet_condition(
        t, l->up, nn_name(name, "%scondition_scale.%zu", prefix, i), 1);
    const int shift = style_unet_condition(
        t, l->up, nn_name(name, "%scondition_shift.%zu", prefix, i), 0);
    l->enlarge = style_unet_convolve(s, x, prefix,
                                     nn_name(name, "style_convs.%zu", 2 * i),
                                     2 * i + 1, side, true);
    x = TAPE_STEP(t, &transform_op, l->enlarge, scale, shift);
    l->same = style_unet_convolve(s, x, prefix,
                                  nn_name(name, "style_convs.%zu", 2 * i + 1),
                                  2 * i + 2, side, false);
    nn_name(name, "%sstylegan_decoder.to_rgbs.%zu", prefix, i);
    l->rgb = style_to_rgb(t, l->same, s->latent, rgb, name, side);
}

/* Weights of the public checkpoints that nothing uses. */
static void style_unet_unused(struct style_unet *s, const char *prefix)
{
    struct params *ps = s->tape.ps;
    char name[120];

    for (size_t i = 0; i < s->levels; i++) {
        size_t dims[4] = { 3, style_unet_width(s, 8u << i), 1, 1 };

        nn_name(name, "%stoRGB.%zu.weight", prefix, i);
        size_t t = params_add(ps, name, 4, dims, PARAM_ZERO, 0);
        ps->tensor[t].frozen = true;
        nn_name(name, "%stoRGB.%zu.bias", prefix, i);
        t = params_add(ps, name, 1, dims, PARAM_ZERO, 0);
        ps->tensor[t].frozen = true;
    }
}

/* All of it, from the features to the last level's picture. */
static void style_unet_steps(struct style_unet *s, const char *prefix)
{
    struct tape *t = &s->tape;
    char name[120];
    int f = style_unet_encoder(s, prefix), x, rgb;

    style_unet_unused(s, prefix);
    style_unet_style(s, f, prefix);
    x = s->conv1 = style_unet_convolve(s, style_unet_start(s, prefix), prefix,
                                       "style_conv1", 0, 4, false);
    nn_name(name, "%sstylegan_decoder.to_rgb1", prefix);
    rgb = style_to_rgb(t, x, s->latent, -1, name, 4);
    for (size_t i = 0; i < s->levels; i++) {
        style_unet_level(s, i, f, x, rgb, prefix);
        f = s->level[i].up;
        x = s->level[i].same;
        rgb = s->level[i].rgb;
    }
    tape_act(t, tape_keep(t, rgb), ACT_SIGMOID);
}

/* Whether n is one. */
static bool style_unet_power_of_two(size_t n)
{
    return n && (n & (n - 1)) == 0;
}

int style_unet_init(struct style_unet *s, struct params *ps,
                    const char *prefix, size_t channels, size_t in_size,
                    size_t out_size, float multiplier, struct error *err)
{
    memset(s, 0, sizeof *s);
    if (!style_unet_power_of_two(in_size) || !style_unet_power_of_two(out_size)
        || out_size < 8 || out_size > 2048 || in_size > 2 * out_size ||
        multiplier <= 0 || !channels)
        return error_set(err, EX_CONFIG, "StyleUNet of %zu to %zu pixels, "
                         "%zu channels, width %g (expected powers of two, "
                         "8 to 2048, and a width above 0)", in_size, out_size,
                         channels, (double)multiplier);
    tape_init(&s->tape, ps, channels, false);
    s->channels = channels;
    s->in_size = in_size;
    s->out_size = out_size;
    s->multiplier = multiplier;
    while (4u << s->levels < out_size)
        s->levels++;
    style_unet_steps(s, prefix);
    return 0;
}

int style_unet_plan(struct style_unet *s, size_t batch, struct nn_options opt,
                    struct error *err)
{
    return tape_plan(&s->tape, batch, s->in_size, s->in_size, opt, err);
}

void style_unet_release(struct style_unet *s)
{
    tape_release(&s->tape);
    memset(s, 0, sizeof *s);
}

void style_unet_forward(float *image, const float *feat, struct style_unet *s)
{
    size_t shape[4];

    tape_forward(NULL, feat, &s->tape);
    const float *x = tape_map(shape, &s->tape, s->tape.count - 1);
    memcpy(image, x, shape[0] * shape[1] * shape[2] * shape[3] * sizeof *image);
}

void style_unet_backward(float *dfeat, const float *dimage,
                         struct style_unet *s)
{
    tape_backward(dfeat, &(struct tape_seed){s->tape.count - 1, dimage}, 1,
                  &s->tape);
}
