/* StyleUNet (GAGAvatar's upsampler): declaration, one pass, and the same
 * backwards. */
#include "lib/net/style_unet.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/nn/image.h"

#define LRELU_GAIN 1.3867505f     /* sqrt(2 / (1 + 0.2^2)) */
#define EPS 1e-8

/* Channels of the encoder at a side; the decoder has twice as many. */
static size_t style_unet_width(const struct style_unet *s, size_t side)
{
    size_t full = side <= 32 ? 256 : 8192 / side;
    size_t n = (size_t)((float)full * s->multiplier + 0.5f);

    return n < 8 ? 8 : (n + 7) / 8 * 8;
}

/* ---- declaring ------------------------------------------------------------
 */

/* StyleGAN2's decoder: style layers, constant input, levels from 4x4 on. */
static void style_unet_decoder_init(struct style_unet *s, const char *prefix)
{
    struct params *ps = s->ps;
    char at[120], name[120], noise[120];
    size_t C = 2 * style_unet_width(s, 4), Z = s->latent;
    size_t constant[4] = { 1, C, 4, 4 };

    nn_name(at, "%sstylegan_decoder.", prefix);
    for (size_t i = 0; i < 8; i++) {
        linear_init(&s->mlp[i], ps,
                    nn_name(name, "%sstyle_mlp.%zu", at, 2 * i + 1), Z, Z,
                    true);
        s->mlp[i].act = ACT_LRELU;
        ps->tensor[s->mlp[i].weight].gain = LRELU_GAIN;
    }
    s->constant = params_add(ps, nn_name(name, "%sconstant_input.weight", at),
                             4, constant, PARAM_NORMAL, 1);
    style_conv_init(&s->conv1, ps, nn_name(name, "%sstyle_conv1", at),
                    nn_name(noise, "%snoises.noise0", at), 4, C, C, Z, false);
    to_rgb_init(&s->rgb1, ps, nn_name(name, "%sto_rgb1", at), C, Z, true);
    for (size_t i = 0; i < s->levels; i++) {
        struct style_level *l = &s->level[i];
        size_t side = 8u << i, out = 2 * style_unet_width(s, side);
        size_t in = 2 * style_unet_width(s, side / 2);

        style_conv_init(&l->enlarge, ps,
                        nn_name(name, "%sstyle_convs.%zu", at, 2 * i),
                        nn_name(noise, "%snoises.noise%zu", at, 2 * i + 1),
                        side, in, out, Z, true);
        style_conv_init(&l->same, ps,
                        nn_name(name, "%sstyle_convs.%zu", at, 2 * i + 1),
                        nn_name(noise, "%snoises.noise%zu", at, 2 * i + 2),
                        side, out, out, Z, false);
        to_rgb_init(&l->rgb, ps, nn_name(name, "%sto_rgbs.%zu", at, i), out, Z,
                    false);
    }
}

/* Weights of the public checkpoints that nothing uses. */
static void style_unet_unused_init(struct style_unet *s, const char *prefix)
{
    char name[120];

    for (size_t i = 0; i < s->levels; i++) {
        size_t dims[4] = { 3, style_unet_width(s, 8u << i), 1, 1 };

        nn_name(name, "%stoRGB.%zu.weight", prefix, i);
        size_t t = params_add(s->ps, name, 4, dims, PARAM_ZERO, 0);
        s->ps->tensor[t].frozen = true;
        nn_name(name, "%stoRGB.%zu.bias", prefix, i);
        t = params_add(s->ps, name, 1, dims, PARAM_ZERO, 0);
        s->ps->tensor[t].frozen = true;
    }
}

/* The way down, the way up, the conditions and the code of the style. */
static void style_unet_encoder_init(struct style_unet *s, const char *prefix)
{
    struct params *ps = s->ps;
    char name[120];
    size_t top = s->halve ? s->in_size : s->out_size, C = style_unet_width(s,
                                                                           4);

    nn_name(name, "%sconv_body_first%s", prefix, s->halve ? ".0" : "");
    style_lrelu_conv(&s->first, ps, name, s->channels, style_unet_width(s, top),
                    1);
    if (s->halve)
        style_res_init(&s->first_res, ps,
                       nn_name(name, "%sconv_body_first.1", prefix),
                       style_unet_width(s, top),
                       style_unet_width(s, s->out_size), false);
    for (size_t i = 0; i < s->levels; i++) {
        struct style_level *l = &s->level[i];
        size_t from = s->out_size >> i, side = 8u << i, up =
            style_unet_width(s, side);

        style_res_init(&l->down, ps,
                       nn_name(name, "%sconv_body_down.%zu", prefix, i),
                       style_unet_width(s, from),
                       style_unet_width(s, from / 2), false);
        style_res_init(&l->up, ps,
                       nn_name(name, "%sconv_body_up.%zu", prefix, i),
                       style_unet_width(s, side / 2), up, true);
        style_condition_init(&l->scale, ps,
                             nn_name(name, "%scondition_scale.%zu", prefix, i),
                             up, 2 * up, 1.0f);
        style_condition_init(&l->shift, ps,
                             nn_name(name, "%scondition_shift.%zu", prefix, i),
                             up, 2 * up, 0.0f);
    }
    style_lrelu_conv(&s->final_conv, ps, nn_name(name, "%sfinal_conv", prefix),
                    C, C, 3);
    linear_init(&s->final_linear, ps, nn_name(name, "%sfinal_linear", prefix),
                16 * C, s->latent, true);
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
    s->ps = ps;
    s->channels = channels;
    s->in_size = in_size;
    s->out_size = out_size;
    s->multiplier = multiplier;
    s->halve = in_size > out_size;
    for (s->levels = 0; 4u << s->levels < out_size;)
        s->levels++;
    s->latent = 2 * style_unet_width(s, 4);
    style_unet_encoder_init(s, prefix);
    style_unet_unused_init(s, prefix);
    style_unet_decoder_init(s, prefix);
    return 0;
}

/* ---- planning -------------------------------------------------------------
 */

/* The way down, in the order of the forward pass. */
static void style_unet_plan_encoder(struct style_unet *s)
{
    struct nn_plan *p = &s->plan;
    size_t B = s->batch, C = style_unet_width(s, 4);
    size_t top = s->halve ? s->in_size : s->out_size;

    if (s->in_size < s->out_size) {
        s->in = nn_plan_map(p, B * top * top * s->channels);
        rescale_plan(&s->enlarge, p, RESCALE_BILINEAR, B, s->in_size,
                     s->in_size, top, top, s->channels);
    }
    s->x0 = nn_plan_map(p, B * top * top * s->first.out);
    conv_plan(&s->first, p, B, top, top);
    if (s->halve)
        style_res_plan(&s->first_res, p, B, top);
    for (size_t i = 0; i < s->levels; i++) {
        style_res_plan(&s->level[i].down, p, B, s->out_size >> i);
        if (i == 0)
            nn_plan_recycle(p, s->x0);
    }
    s->inner = nn_plan_map(p, B * 16 * C);
    conv_plan(&s->final_conv, p, B, 4, 4);
    s->flat = nn_plan_floats(p, B * 16 * C);
    s->code = nn_plan_floats(p, B * s->latent);
    linear_plan(&s->final_linear, p, B);
    s->normal = nn_plan_floats(p, B * s->latent);
    for (size_t i = 0; i < 8; i++) {
        s->style[i] = nn_plan_floats(p, B * s->latent);
        linear_plan(&s->mlp[i], p, B);
    }
}

/* The order of the forward pass, so that maps are shared rightly. */
static void style_unet_plan_decoder(struct style_unet *s)
{
    struct nn_plan *p = &s->plan;
    size_t B = s->batch, C = 2 * style_unet_width(s, 4);

    s->constants = nn_plan_floats(p, B * 16 * C);
    style_conv_plan(&s->conv1, p, B, 4, 4);
    to_rgb_plan(&s->rgb1, p, B, 4, 4);
    float *f = s->inner, *x = s->conv1.y;
    for (size_t i = 0; i < s->levels; i++) {
        struct style_level *l = &s->level[i];
        struct style_res *down = &s->level[s->levels - 1 - i].down;
        size_t side = 8u << i, half = side / 2;

        l->side = side;
        l->f = nn_plan_map(p, B * half * half * l->up.conv1.in);
        nn_plan_recycle(p, f);
        nn_plan_recycle(p, down->out);
        style_res_plan(&l->up, p, B, half);
        nn_plan_recycle(p, l->f);
        style_condition_plan(&l->scale, p, B, side);
        style_condition_plan(&l->shift, p, B, side);
        style_conv_plan(&l->enlarge, p, B, side, side);
        nn_plan_recycle(p, x);
        l->sft = nn_plan_backward(p)
            ? nn_plan_map(p, B * side * side * l->enlarge.out)
            : l->enlarge.y;
        nn_plan_recycle(p, l->scale.out);
        nn_plan_recycle(p, l->shift.out);
        style_conv_plan(&l->same, p, B, side, side);
        nn_plan_recycle(p, l->enlarge.y);
        to_rgb_plan(&l->rgb, p, B, side, side);
        f = l->up.out;
        x = l->same.y;
    }
    s->image = nn_plan_floats(p, B * s->out_size * s->out_size * 3);
}

/* Gradients on their way; the skips keep theirs at each level. */
static void style_unet_plan_gradients(struct style_unet *s)
{
    struct nn_plan *p = &s->plan;
    size_t B = s->batch, top = s->halve ? s->in_size : s->out_size;
    size_t most = top * top * s->first.out;
    size_t in = top * top * s->channels;

    for (size_t i = 0; i < s->levels; i++) {
        struct style_level *l = &s->level[i];
        size_t n = l->side * l->side * l->enlarge.in;

        most = n > most ? n : most;
        l->ddown = nn_plan_floats(p, B * (s->out_size >> (i + 1)) *
                                         (s->out_size >> (i + 1)) *
                                         l->down.conv2.out);
    }
    most = in > most ? in : most;
    for (int i = 0; i < 5; i++)
        s->g[i] = nn_plan_floats(p, B * most);
    s->dlatent = nn_plan_floats(p, B * s->latent);
    s->dstyle = nn_plan_floats(p, B * s->latent);
    s->dflat = nn_plan_floats(p, B * 16 * style_unet_width(s, 4));
    for (int i = 0; i < 2; i++)
        s->drgb[i] = nn_plan_floats(p, B * s->out_size * s->out_size * 3);
}

int style_unet_plan(struct style_unet *s, size_t batch, struct nn_options opt,
                    struct error *err)
{
    nn_plan_release(&s->plan);
    nn_plan_init(&s->plan, opt);
    s->batch = batch;
    style_unet_plan_encoder(s);
    style_unet_plan_decoder(s);
    if (nn_plan_backward(&s->plan))
        style_unet_plan_gradients(s);
    if (nn_plan_finish(&s->plan, err))
        return -1;
    style_unet_update(s);
    return 0;
}

/* conv_update as style_unet_each wants it. */
static void style_unet_update_one(struct conv *c)
{
    conv_update(c, NULL);
}

/* Every plain convolution that is planned. */
static void style_unet_each(struct style_unet *s, void (*what)(struct conv *))
{
    struct conv *few[] = { &s->first, &s->final_conv, &s->final_linear,
                           &s->first_res.conv1, &s->first_res.conv2,
                           &s->first_res.skip };

    for (size_t i = 0; i < sizeof few / sizeof *few; i++)
        if (few[i]->impl)
            what(few[i]);
    for (size_t i = 0; i < 8; i++)
        if (s->mlp[i].impl)
            what(&s->mlp[i]);
    for (size_t k = 0; k < s->levels; k++) {
        struct style_level *l = &s->level[k];
        struct conv *all[] = { &l->down.conv1, &l->down.conv2, &l->down.skip,
                               &l->up.conv1, &l->up.conv2, &l->up.skip,
                               &l->scale.a, &l->scale.b, &l->shift.a,
                               &l->shift.b };

        for (size_t i = 0; i < sizeof all / sizeof *all; i++)
            if (all[i]->impl)
                what(all[i]);
    }
}

void style_unet_update(struct style_unet *s)
{
    style_unet_each(s, style_unet_update_one);
    style_conv_update(&s->conv1);
    to_rgb_update(&s->rgb1);
    for (size_t i = 0; i < s->levels; i++) {
        style_conv_update(&s->level[i].enlarge);
        style_conv_update(&s->level[i].same);
        to_rgb_update(&s->level[i].rgb);
    }
}

void style_unet_release(struct style_unet *s)
{
    style_unet_each(s, conv_release);
    style_conv_release(&s->conv1);
    to_rgb_release(&s->rgb1);
    for (size_t i = 0; i < s->levels; i++) {
        style_conv_release(&s->level[i].enlarge);
        style_conv_release(&s->level[i].same);
        to_rgb_release(&s->level[i].rgb);
    }
    nn_plan_release(&s->plan);
    memset(s, 0, sizeof *s);
}

/* ---- one pass -------------------------------------------------------------
 */

/* flat (B,C*16) <-> inner (B,16,C) */
static void style_unet_flatten(float *flat, float *inner, size_t B, size_t C,
                               bool back)
{
    for (size_t n = 0; n < B; n++)
        for (size_t i = 0; i < 16; i++)
            for (size_t c = 0; c < C; c++) {
                float *a = flat + (n * C + c) * 16 + i;
                float *b = inner + (n * 16 + i) * C + c;

                if (back)
                    *b += *a;
                else
                    *a = *b;
            }
}

/* s = code rsqrt(mean(code^2) + eps), then the eight layers. */
static void style_unet_style_forward(struct style_unet *s)
{
    size_t Z = s->latent;

    style_unet_flatten(s->flat, s->inner, s->batch, style_unet_width(s, 4),
                       false);
    conv_forward(s->code, s->flat, &s->final_linear);
    for (size_t n = 0; n < s->batch; n++) {
        const float *c = s->code + n * Z;
        double sum = 0;

        for (size_t i = 0; i < Z; i++)
            sum += (double)c[i] * (double)c[i];
        double unit = 1 / sqrt(sum / (double)Z + EPS);
        for (size_t i = 0; i < Z; i++)
            s->normal[n * Z + i] = (float)((double)c[i] * unit);
    }
    for (size_t i = 0; i < 8; i++)
        conv_forward(s->style[i], i ? s->style[i - 1] : s->normal, &s->mlp[i]);
}

/* The way down, to the innermost map s->inner. */
static void style_unet_encoder_forward(const float *feat, struct style_unet *s)
{
    const float *x = feat;

    if (s->in) {
        rescale_forward(s->in, feat, &s->enlarge);
        x = s->in;
    }
    s->feat = x;
    conv_forward(s->x0, x, &s->first);
    x = s->x0;
    if (s->halve) {
        style_res_forward(x, &s->first_res);
        x = s->first_res.out;
    }
    for (size_t i = 0; i < s->levels; i++) {
        style_res_forward(x, &s->level[i].down);
        x = s->level[i].down.out;
    }
    conv_forward(s->inner, x, &s->final_conv);
}

/* y = x scale + shift, two maps */
static void style_unet_transform(float *y, const float *x, const float *scale,
                                 const float *shift, size_t n)
{
#pragma omp parallel for simd schedule(static)
    for (size_t i = 0; i < n; i++)
        y[i] = x[i] * scale[i] + shift[i];
}

/* One level up: conditions from the encoder, two style convolutions,
 * picture. */
static void style_unet_level_forward(struct style_unet *s, size_t i,
                                     const float *f, const float *x,
                                     const float *rgb)
{
    struct style_level *l = &s->level[i];
    const struct style_res *down = &s->level[s->levels - 1 - i].down;
    const float *latent = s->style[7];
    size_t n = s->batch * l->side / 2 * l->side / 2 * l->up.conv1.in;

    memcpy(l->f, f, n * sizeof *f);
    image_add(l->f, down->out, n);
    style_res_forward(l->f, &l->up);
    style_condition_forward(l->up.out, &l->scale);
    style_condition_forward(l->up.out, &l->shift);
    style_conv_forward(x, latent, &l->enlarge);
    style_unet_transform(l->sft, l->enlarge.y, l->scale.out, l->shift.out,
                         s->batch * l->side * l->side * l->enlarge.out);
    style_conv_forward(l->sft, latent, &l->same);
    to_rgb_forward(l->same.y, latent, rgb, &l->rgb);
}

void style_unet_forward(float *image, const float *feat, struct style_unet *s)
{
    size_t C = 2 * style_unet_width(s, 4), n = s->out_size * s->out_size * 3;
    const float *constant = param_w(s->ps, s->constant);

    style_unet_encoder_forward(feat, s);
    style_unet_style_forward(s);
    for (size_t b = 0; b < s->batch; b++)
        for (size_t i = 0; i < 16; i++)
            for (size_t c = 0; c < C; c++)
                s->constants[(b * 16 + i) * C + c] = constant[c * 16 + i];
    style_conv_forward(s->constants, s->style[7], &s->conv1);
    to_rgb_forward(s->conv1.y, s->style[7], NULL, &s->rgb1);
    const float *f = s->inner, *x = s->conv1.y, *rgb = s->rgb1.rgb;
    for (size_t i = 0; i < s->levels; i++) {
        style_unet_level_forward(s, i, f, x, rgb);
        f = s->level[i].up.out;
        x = s->level[i].same.y;
        rgb = s->level[i].rgb.rgb;
    }
    act_forward(s->image, rgb, ACT_SIGMOID, s->batch * n);
    memcpy(image, s->image, s->batch * n * sizeof *image);
}

const float *style_unet_latent(const struct style_unet *s)
{
    return s->style[7];
}

const float *style_unet_logits(const struct style_unet *s)
{
    return s->level[s->levels - 1].rgb.rgb;
}

/* ---- and back -------------------------------------------------------------
 */

/* d(x scale + shift): dscale = dy x, dx = dy scale (may be over dy). */
static void style_unet_transform_backward(float *dx, float *dscale,
                                          const float *dy, const float *x,
                                          const float *scale, size_t n)
{
#pragma omp parallel for simd schedule(static)
    for (size_t i = 0; i < n; i++) {
        float g = dy[i];

        dscale[i] = g * x[i];
        dx[i] = g * scale[i];
    }
}

/* On entry g[0]: gradient of same.y from the next level, g[1]: of up.out from
 * the next level; drgb: of this level's picture.  On return the same for the
 * level before (its x, and f). */
static void style_unet_level_backward(struct style_unet *s, size_t i,
                                      const float *x, float *drgb,
                                      float *dprevious)
{
    struct style_level *l = &s->level[i];
    struct style_level *other = &s->level[s->levels - 1 - i];
    const float *latent = s->style[7];
    float **g = s->g;
    size_t n = s->batch * l->side * l->side * l->enlarge.out;
    size_t half = s->batch * l->side * l->side / 4 * l->up.conv1.in;

    to_rgb_backward(g[0], s->dlatent, dprevious, drgb, l->same.y, latent,
                    &l->rgb);
    style_conv_backward(g[2], s->dlatent, g[0], l->sft, latent, g[3], g[4],
                        &l->same);
    /* g2: gradient of sft = y scale + shift */
    memcpy(g[3], g[2], n * sizeof *g[3]);
    style_condition_backward(g[1], g[3], l->up.out, g[0], g[4], &l->shift);
    style_unet_transform_backward(g[2], g[3], g[2], l->enlarge.y, l->scale.out,
                                  n);
    style_condition_backward(g[1], g[3], l->up.out, g[0], g[4], &l->scale);
    style_conv_backward(g[0], s->dlatent, g[2], x, latent, g[3], g[4],
                        &l->enlarge);
    style_res_backward(g[2], g[1], l->f, g[3], g[4], &l->up);
    memcpy(other->ddown, g[2], half * sizeof *g[2]);
    float *swap = g[1];
    g[1] = g[2];
    g[2] = swap;
}

/* dlatent through the eight layers and the normalisation, to the innermost
 * map's gradient, which is added to dinner. */
static void style_unet_style_backward(float *dinner, struct style_unet *s)
{
    size_t Z = s->latent;
    float *a = s->dlatent, *b = s->dstyle;

    for (size_t i = 8; i-- > 0;) {
        conv_backward(b, a, s->style[i], i ? s->style[i - 1] : s->normal,
                      &s->mlp[i]);
        float *swap = a;
        a = b;
        b = swap;
    }
    for (size_t n = 0; n < s->batch; n++) {
        const float *c = s->code + n * Z;
        float *d = a + n * Z;
        double sum = 0, along = 0;

        for (size_t i = 0; i < Z; i++) {
            sum += (double)c[i] * (double)c[i];
            along += (double)c[i] * (double)d[i];
        }
        double m = sum / (double)Z + EPS, unit = 1 / sqrt(m);
        for (size_t i = 0; i < Z; i++)
            d[i] = (float)(unit * ((double)d[i] - (double)c[i] * along /
                                                      (m * (double)Z)));
    }
    conv_backward(s->dflat, a, s->code, s->flat, &s->final_linear);
    style_unet_flatten(s->dflat, dinner, s->batch, style_unet_width(s, 4),
                       true);
}

/* From the innermost map's gradient g[1] and the skips' to dfeat. */
static void style_unet_encoder_backward(float *dfeat, struct style_unet *s)
{
    float **g = s->g;
    const struct style_level *last = &s->level[s->levels - 1];
    size_t n = s->batch * 16 * style_unet_width(s, 4);

    /* g1: gradient of final_conv's output */
    conv_backward(g[0], g[1], s->inner, last->down.out, &s->final_conv);
    image_add(g[0], last->ddown, n);
    for (size_t i = s->levels; i-- > 0;) {
        struct style_level *l = &s->level[i];
        const float *x = i ? s->level[i - 1].down.out
                       : s->halve ? s->first_res.out : s->x0;

        style_res_backward(g[1], g[0], x, g[2], g[3], &l->down);
        if (i)
            image_add(g[1], s->level[i - 1].ddown,
                      style_res_size(&s->level[i - 1].down));
        float *swap = g[0];
        g[0] = g[1];
        g[1] = swap;
    }
    if (s->halve) {
        style_res_backward(g[1], g[0], s->x0, g[2], g[3], &s->first_res);
        float *swap = g[0];
        g[0] = g[1];
        g[1] = swap;
    }
    conv_backward(s->in && dfeat ? g[1] : dfeat, g[0], s->x0, s->feat,
                  &s->first);
    if (s->in && dfeat)
        rescale_backward(dfeat, g[1], &s->enlarge);
}

void style_unet_backward(float *dfeat, const float *dimage,
                         struct style_unet *s)
{
    size_t B = s->batch, C = 2 * style_unet_width(s, 4), L = s->levels;
    size_t top = s->out_size;
    float **g = s->g, *drgb = s->drgb[0], *dprev = s->drgb[1];

    memset(s->dlatent, 0, B * s->latent * sizeof *s->dlatent);
    act_backward_out(drgb, dimage, s->image, ACT_SIGMOID, B * top * top * 3);
    memset(g[0], 0, B * top * top * 2 * style_unet_width(s, top) * sizeof
           *g[0]);
    memset(g[1], 0, style_res_size(&s->level[L - 1].up) * sizeof *g[1]);
    for (size_t i = L; i-- > 0;) {
        style_unet_level_backward(s, i,
                                  i ? s->level[i - 1].same.y : s->conv1.y,
                                  drgb, dprev);
        float *swap = drgb;
        drgb = dprev;
        dprev = swap;
    }
    to_rgb_backward(g[0], s->dlatent, NULL, drgb, s->conv1.y, s->style[7],
                    &s->rgb1);
    style_conv_backward(g[2], s->dlatent, g[0], s->constants, s->style[7],
                        g[3], g[4], &s->conv1);
    float *dc = param_g(s->ps, s->constant);
    for (size_t b = 0; b < B; b++)
        for (size_t i = 0; i < 16; i++)
            for (size_t c = 0; c < C; c++)
                dc[c * 16 + i] += g[2][(b * 16 + i) * C + c];
    style_unet_style_backward(g[1], s);
    style_unet_encoder_backward(dfeat, s);
}
