/* Case 02: the vision transformer, forward and backward. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/net/dinov2.h"
#include "tests/golden/layout.h"

#define EMBED 96

/* Patch tokens (B,N,E) or class tokens (B,E) of x (B,1+N,E), fresh. */
static float *dinov2_part(const float *x, const struct dinov2 *d, bool cls)
{
    size_t N = cls ? 1 : d->tokens - 1, E = EMBED;
    float *out = malloc(d->batch * N * E * sizeof *out);

    for (size_t b = 0; b < d->batch; b++)
        memcpy(out + b * N * E, x + (b * d->tokens + !cls) * E,
               N * E * sizeof *out);
    return out;
}

static void compare_part(struct golden *g, const char *name, const float *x,
                         const struct dinov2 *d, bool cls)
{
    float *p = dinov2_part(x, d, cls);

    golden_compare(g, name, p, d->batch * (cls ? 1 : d->tokens - 1) * EMBED);
    free(p);
}

static void compare_all(struct golden *g, const struct dinov2 *d, bool raw)
{
    char name[32];
    size_t E = EMBED;

    golden_compare(g, "pos_embed_resized", dinov2_position(d), d->tokens * E);
    if (raw)
        golden_compare(g, "tokens", dinov2_raw(d, 0),
                       d->batch * d->tokens * E);
    for (size_t k = 0; k < 4; k++) {
        snprintf(name, sizeof name, "layer%zu.raw", k);
        if (raw)
            compare_part(g, name, dinov2_raw(d, k + 1), d, false);
        snprintf(name, sizeof name, "layer%zu.norm_patch", k);
        compare_part(g, name, dinov2_tokens(d, k), d, false);
        snprintf(name, sizeof name, "layer%zu.norm_cls", k);
        compare_part(g, name, dinov2_tokens(d, k), d, true);
    }
    compare_part(g, "forward", dinov2_tokens(d, 3), d, true);
    float *global = malloc(d->batch * E * sizeof *global);
    for (size_t b = 0; b < d->batch; b++)
        memcpy(global + b * E, dinov2_tokens(d, 3) + (b * d->tokens + 1) * E,
               E * sizeof *global);
    golden_compare(g, "dinobase_global", global, d->batch * E);
    free(global);
}

/* sum_k sum(norm_patch_k probe) + sum(norm_cls_3 probe) */
static void dinov2_gradients(struct golden *g, struct dinov2 *d,
                             struct params *ps, const struct golden_weights *w,
                             const size_t in[4])
{
    size_t B = d->batch, T = d->tokens, E = EMBED;
    float *probe = golden_probe_array(g->seed, B * T * E), *dtok[4];

    for (int k = 0; k < 4; k++) {
        dtok[k] = calloc(B * T * E, sizeof(float));
        for (size_t b = 0; b < B; b++) {
            memcpy(dtok[k] + (b * T + 1) * E, probe + b * (T - 1) * E,
                   (T - 1) * E * sizeof(float));
            if (k == 3)
                memcpy(dtok[k] + b * T * E, probe + b * E, E * sizeof(float));
        }
    }
    float *drgb = malloc(in[0] * in[1] * in[2] * in[3] * sizeof *drgb);
    dinov2_backward(drgb, (const float *const *)dtok, d);
    layout_compare(g, "grad.input", drgb, in[0], in[1] * in[2], in[3], false);
    static const char *const names[] = { "pos_embed",
                                         "blocks.0.attn.qkv.weight",
                                         "patch_embed.proj.weight" };
    for (int i = 0; i < 3; i++) {
        char name[64];
        size_t t = params_find(ps, names[i]);

        snprintf(name, sizeof name, "grad.%s", names[i]);
        golden_compare(g, name, param_g(ps, t), ps->tensor[t].count);
    }
    golden_weights_gradients(g, ps, w, "");
    for (int k = 0; k < 4; k++)
        free(dtok[k]);
    free(probe);
    free(drgb);
}

static void run_dinov2_vit(struct golden *g)
{
    struct dinov2 d;
    struct params ps;
    struct golden_weights w;
    struct error err = { 0 };
    struct dinov2_config config = { EMBED, 4, 3, 14, 37, 4, 0, false };
    size_t in[4];

    golden_input_shape(in, g);
    params_init(&ps);
    if (dinov2_init(&d, &ps, "", &config, false, &err) ||
        params_allocate(&ps, &err) || params_allocate_gradients(&ps, &err)) {
        golden_fail(g, &err);
        return;
    }
    golden_weights_open(&w, g, NULL);
    golden_weights_fill(&ps, &w, g, "");
    float *image = golden_image("input.image", g->seed, in[0] * in[3], in[1],
                                in[2], true);
    float *rgb = layout_rows(image, in[0], in[1] * in[2], in[3]);
    for (int i = 0; i < 2; i++) {
        struct nn_options opt = { i ? NN_FROZEN : NN_INFER, NN_F32 };

        if (dinov2_plan(&d, in[0], in[1], in[2], opt, &err)) {
            golden_fail(g, &err);
            break;
        }
        dinov2_forward(rgb, &d);
        compare_all(g, &d, i);
        if (i)
            dinov2_gradients(g, &d, &ps, &w, in);
    }
    free(image);
    free(rgb);
    golden_weights_close(&w);
    dinov2_release(&d);
    params_release(&ps);
}

GOLDEN_CASE("02_dinov2_vit", run_dinov2_vit)
