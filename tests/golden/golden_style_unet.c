/* Case 05: StyleUNet, forward and backward. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/net/style_unet.h"
#include "tests/golden/layout.h"

static void compare_map(struct golden *g, const char *what, size_t i,
                        const char *end, const struct style_unet *s, int map)
{
    char name[64];
    size_t shape[4];
    const float *x = tape_map(shape, &s->tape, map);

    snprintf(name, sizeof name, "%s%zu%s", what, i, end);
    layout_compare(g, name, x, shape[0], shape[1] * shape[2], shape[3], false);
}

static void compare_row(struct golden *g, const char *name,
                        const struct style_unet *s, int map)
{
    size_t shape[4];
    const float *x = tape_map(shape, &s->tape, map);

    golden_compare(g, name, x, shape[0] * shape[3]);
}

static void compare_maps(struct golden *g, const struct style_unet *s)
{
    compare_row(g, "style_code", s, s->code);
    compare_row(g, "latent", s, s->latent);
    compare_map(g, "dec.style_conv", 1, "", s, s->conv1);
    for (size_t i = 0; i < s->levels; i++) {
        const struct style_level *l = &s->level[i];

        compare_map(g, "down", i, "", s, l->down);
        compare_map(g, "up", i, "", s, l->up);
        compare_map(g, "dec.style_conv", 2 * i, "_out", s, l->enlarge);
        compare_map(g, "dec.style_conv", 2 * i + 1, "_out", s, l->same);
        compare_map(g, "dec.rgb", i, "", s, l->rgb);
    }
}

static void style_unet_gradients(struct golden *g, struct style_unet *s,
                                 struct params *ps,
                                 const struct golden_weights *w)
{
    static const char *const names[] = {
        "final_linear.bias", "stylegan_decoder.constant_input.weight",
        "stylegan_decoder.style_convs.0.modulated_conv.weight",
        "stylegan_decoder.style_convs.0.modulated_conv.modulation.weight",
        "stylegan_decoder.style_convs.1.weight"
    };
    size_t B = s->tape.picture.batch, P = s->out_size * s->out_size;
    size_t in = s->in_size * s->in_size;
    float *probe = golden_probe_array(g->seed, B * 3 * P);
    float *dout = layout_rows(probe, B, P, 3);
    float *dfeat = malloc(B * in * s->channels * sizeof *dfeat);

    style_unet_backward(dfeat, dout, s);
    layout_compare(g, "grad.input", dfeat, B, in, s->channels, true);
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        char name[100];
        size_t t = params_find(ps, names[i]);

        snprintf(name, sizeof name, "grad.%s", names[i]);
        golden_compare_l2(g, name, param_g(ps, t), ps->tensor[t].count);
    }
    /* 10^7 leaky units: some lie within rounding of their kink */
    g->kinks = true;
    golden_weights_gradients(g, ps, w, "");
    free(probe);
    free(dout);
    free(dfeat);
}

static void run_mode(struct golden *g, struct style_unet *s, struct params *ps,
                     const struct golden_weights *w, const float *feat,
                     size_t batch, enum nn_mode mode)
{
    struct nn_options opt = { mode, mode == NN_INFER ? NN_FAST : NN_F32 };
    struct error err = { 0 };
    size_t P = s->out_size * s->out_size;

    if (style_unet_plan(s, batch, opt, &err)) {
        golden_fail(g, &err);
        return;
    }
    float *image = malloc(batch * P * 3 * sizeof *image);
    style_unet_forward(image, feat, s);
    layout_compare(g, "image", image, batch, P, 3, false);
    layout_compare(g, "logits",
                   tape_map(NULL, &s->tape, s->level[s->levels - 1].rgb), batch,
                   P, 3, false);
    free(image);
    if (mode == NN_INFER)
        return;
    compare_maps(g, s);
    if (golden_has(g, "grad.final_linear.bias"))
        style_unet_gradients(g, s, ps, w);
}

static void run_style_unet(struct golden *g)
{
    struct style_unet s;
    struct params ps;
    struct golden_weights w;
    struct error err = { 0 };
    cJSON *shape = golden_json(g, "input_shape");
    cJSON *config = golden_json(g, "config");
    size_t B = (size_t)cJSON_GetArrayItem(shape, 0)->valuedouble;
    size_t side = (size_t)cJSON_GetArrayItem(shape, 2)->valuedouble;
    size_t out = (size_t)cJSON_GetObjectItem(config, "out_size")->valuedouble;

    cJSON_Delete(shape);
    cJSON_Delete(config);
    params_init(&ps);
    if (style_unet_init(&s, &ps, "", 32, side, out, 1, &err) ||
        params_allocate(&ps, &err) || params_allocate_gradients(&ps, &err)) {
        golden_fail(g, &err);
        return;
    }
    golden_weights_open(&w, g, NULL);
    golden_weights_fill(&ps, &w, g, "");
    float *image = golden_image("input.image", g->seed, B * 32, side, side,
                                true);
    float *feat = layout_rows(image, B, side * side, 32);
    run_mode(g, &s, &ps, &w, feat, B, NN_INFER);
    run_mode(g, &s, &ps, &w, feat, B, NN_FROZEN);
    free(image);
    free(feat);
    golden_weights_close(&w);
    style_unet_release(&s);
    params_release(&ps);
}

GOLDEN_CASE("05_style_unet", run_style_unet)
