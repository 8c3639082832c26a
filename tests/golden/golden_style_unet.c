/* Case 05: StyleUNet, forward and backward. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/net/style_unet.h"
#include "tests/golden/golden_net.h"

/* Map "<what><i><end>", (B,side,side,C). */
static void style_unet_compare_map(struct golden *g, const char *what,
                                   size_t i, const char *end, const float *x,
                                   size_t B, size_t side, size_t C)
{
    char name[64];

    snprintf(name, sizeof name, "%s%zu%s", what, i, end);
    layout_compare(g, name, x, B, side * side, C, false);
}

static void style_unet_compare_maps(struct golden *g,
                                    const struct style_unet *s)
{
    size_t B = s->batch;

    golden_compare(g, "style_code", s->code, B * s->latent);
    golden_compare(g, "latent", style_unet_latent(s), B * s->latent);
    layout_compare(g, "dec.style_conv1", s->conv1.y, B, 16, s->conv1.out,
                   false);
    for (size_t i = 0; i < s->levels; i++) {
        const struct style_level *l = &s->level[i];

        style_unet_compare_map(g, "down", i, "", l->down.out, B,
                               s->out_size >> (i + 1), l->down.conv2.out);
        style_unet_compare_map(g, "up", i, "", l->up.out, B, l->side,
                               l->up.conv2.out);
        style_unet_compare_map(g, "dec.style_conv", 2 * i, "_out",
                               l->enlarge.y, B, l->side, l->enlarge.out);
        style_unet_compare_map(g, "dec.style_conv", 2 * i + 1, "_out",
                               l->same.y, B, l->side, l->same.out);
        style_unet_compare_map(g, "dec.rgb", i, "", l->rgb.rgb, B, l->side, 3);
    }
}

/* sum(image probe), back to the features and the weights. */
static void style_unet_gradients(struct golden_net *n, struct style_unet *s)
{
    static const char *const names[] = {
        "final_linear.bias", "stylegan_decoder.constant_input.weight",
        "stylegan_decoder.style_convs.0.modulated_conv.weight",
        "stylegan_decoder.style_convs.0.modulated_conv.modulation.weight",
        "stylegan_decoder.style_convs.1.weight"
    };
    struct golden *g = n->g;
    size_t B = s->batch, P = s->out_size * s->out_size;
    size_t in = s->in_size * s->in_size;
    float *probe = golden_probe_array(g->seed, B * 3 * P);
    float *dout = layout_rows(probe, B, P, 3);
    float *dfeat = malloc(B * in * s->channels * sizeof *dfeat);

    style_unet_backward(dfeat, dout, s);
    layout_compare(g, "grad.input", dfeat, B, in, s->channels, true);
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        golden_net_gradient(g, &n->ps, names[i], true);
    /* 10^7 leaky units: some lie within rounding of their kink */
    g->kinks = true;
    golden_weights_gradients(g, &n->ps, &n->w, "");
    free(probe);
    free(dout);
    free(dfeat);
}

/* Inference as it is used, or everything in float. */
static void style_unet_run_mode(struct golden_net *n, struct style_unet *s,
                                enum nn_mode mode)
{
    struct nn_options opt = { mode, mode == NN_INFER ? NN_FAST : NN_F32 };
    struct golden *g = n->g;
    struct error err = { 0 };
    size_t P = s->out_size * s->out_size, B = n->in[0];

    if (golden_failed(g, style_unet_plan(s, B, opt, &err), &err))
        return;
    float *image = malloc(B * P * 3 * sizeof *image);
    style_unet_forward(image, n->rgb, s);
    layout_compare(g, "image", image, B, P, 3, false);
    layout_compare(g, "logits", style_unet_logits(s), B, P, 3, false);
    free(image);
    if (mode == NN_INFER)
        return;
    style_unet_compare_maps(g, s);
    if (golden_has(g, "grad.final_linear.bias"))
        style_unet_gradients(n, s);
}

static void style_unet_run(struct golden *g)
{
    struct style_unet s;
    struct golden_net n;
    struct error err = { 0 };
    cJSON *config = golden_json(g, "config");
    size_t out = (size_t)cJSON_GetObjectItem(config, "out_size")->valuedouble;

    cJSON_Delete(config);
    golden_net_begin(&n, g);
    int rc = style_unet_init(&s, &n.ps, "", n.in[3], n.in[1], out, 1, &err);
    if (!golden_net_ready(&n, rc, true, &err))
        return;
    style_unet_run_mode(&n, &s, NN_INFER);
    style_unet_run_mode(&n, &s, NN_FROZEN);
    golden_net_end(&n);
    style_unet_release(&s);
}

GOLDEN_CASE("05_style_unet", style_unet_run)
