/* StyleUNet (GAGAvatar's upsampler): its layers and their buffers; one pass is
 * in style_unet_pass.c. */
#include "lib/net/style_unet.h"

#include <string.h>
#include <sysexits.h>


size_t style_unet_width(const struct style_unet *s, size_t side)
{
    size_t full = side <= 32 ? 256 : 8192 / side;
    size_t n = (size_t)((float)full * s->multiplier + 0.5f);

    return n < 8 ? 8 : (n + 7) / 8 * 8;
}

/* ---- declaring ----------------------------------------------------------- */

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
                    nn_name(name, "%sstyle_mlp.%zu", at, 2 * i + 1), Z, Z);
        s->mlp[i].act = ACT_LRELU;
        ps->tensor[s->mlp[i].weight].gain = ACT_LRELU_GAIN;
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
                             up, 2 * up, 1);
        style_condition_init(&l->shift, ps,
                             nn_name(name, "%scondition_shift.%zu", prefix, i),
                             up, 2 * up, 0);
    }
    style_lrelu_conv(&s->final_conv, ps, nn_name(name, "%sfinal_conv", prefix),
                     C, C, 3);
    linear_init(&s->final_linear, ps, nn_name(name, "%sfinal_linear", prefix),
                16 * C, s->latent);
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

/* ---- planning ------------------------------------------------------------ */

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
    size_t max = top * top * s->first.out;
    size_t in = top * top * s->channels;

    for (size_t i = 0; i < s->levels; i++) {
        struct style_level *l = &s->level[i];
        size_t n = l->side * l->side * l->enlarge.in;

        max = n > max ? n : max;
        l->ddown = nn_plan_floats(p, B * (s->out_size >> (i + 1)) *
                                         (s->out_size >> (i + 1)) *
                                         l->down.conv2.out);
    }
    max = in > max ? in : max;
    for (int i = 0; i < 5; i++)
        s->g[i] = nn_plan_floats(p, B * max);
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
    return nn_plan_finish(&s->plan, err);
}

void style_unet_release(struct style_unet *s)
{
    nn_plan_release(&s->plan);
    memset(s, 0, sizeof *s);
}
