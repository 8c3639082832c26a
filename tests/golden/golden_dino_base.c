/* Case 03: the fusion head on a reduced transformer. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/net/dino_base.h"
#include "tests/golden/layout.h"

static void compare_stages(struct golden *g, struct dino_base *d)
{
    const struct {
        const char *name;
        const int *map;
    } kinds[3] = { { "cat", d->cat }, { "layer_rn", d->rn },
                   { "refine", d->refine } };
    char name[32];
    size_t s[4];

    for (size_t k = 0; k < DINO_LEVELS; k++)
        for (int i = 0; i < 3; i++) {
            const float *x = tape_map(s, &d->tape, kinds[i].map[k]);
            size_t C = i ? s[3] : tape_layer(&d->tape, d->rn[k])->in;
            /* cat is stored with its channels padded */
            float *tight = malloc(s[0] * s[1] * s[2] * C * sizeof *tight);

            for (size_t r = 0; r < s[0] * s[1] * s[2]; r++)
                memcpy(tight + r * C, x + r * s[3], C * sizeof *tight);
            snprintf(name, sizeof name, "%s%zu", kinds[i].name, k);
            layout_compare(g, name, tight, s[0], s[1] * s[2], C, false);
            free(tight);
        }
}

static void dino_gradients(struct golden *g, struct dino_base *d,
                           struct params *ps, const struct golden_weights *w)
{
    static const char *const names[] = {
        "projects.0.weight", "resize_layers.0.weight", "resize_layers.3.bias",
        "layer_rn.2.weight", "refinenet.3.resConfUnit1.conv1.weight",
        "output_conv.bias"
    };
    size_t s[4];

    tape_map(s, &d->tape, d->feature);
    float *probe = golden_probe_array(g->seed, s[0] * s[1] * s[2] * s[3]);
    float *dout = layout_rows(probe, s[0], s[1] * s[2], s[3]);
    /* the loss is of `feature` itself */
    tape_backward(NULL, &(struct tape_seed){d->feature, dout}, 1, &d->tape);
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        char name[80];
        size_t t = params_find(ps, names[i]);

        snprintf(name, sizeof name, "grad.%s", names[i]);
        golden_compare_l2(g, name, param_g(ps, t), ps->tensor[t].count);
    }
    golden_weights_gradients(g, ps, w, "");
    free(probe);
    free(dout);
}

static void run_mode(struct golden *g, struct dino_base *d, struct params *ps,
                     const struct golden_weights *w, const float *rgb,
                     size_t h, size_t wide, size_t size, enum nn_mode mode)
{
    struct nn_options opt = { mode, mode == NN_INFER ? NN_FAST : NN_F32 };
    struct error err = { 0 };
    char name[32];

    if (dino_base_plan(d, 1, h, wide, opt, &err)) {
        golden_fail(g, &err);
        return;
    }
    size_t E = d->vit.config.embed, s[4];
    size_t C = tape_channels(&d->tape, d->feature), n = size * size * C;
    float *features = malloc(n * sizeof *features);
    tape_forward(features, rgb, &d->tape);
    snprintf(name, sizeof name, "feature_size%zu", size);
    layout_compare(g, name, features, 1, size * size, C, false);
    if (mode != NN_INFER) {
        golden_compare(g, "global", dinov2_tokens(&d->vit, 3) + E, E);
        compare_stages(g, d);
        const float *x = tape_map(s, &d->tape, d->feature);
        layout_compare(g, "feature", x, 1, s[1] * s[2], s[3], false);
        if (golden_has(g, "grad.output_conv.bias"))
            dino_gradients(g, d, ps, w);
    }
    free(features);
}

static void run_dino_base(struct golden *g)
{
    struct dino_base d;
    struct params ps;
    struct golden_weights w;
    struct error err = { 0 };
    struct dinov2_config vit = { 96, 4, 3, 14, 37, 4, 0, false };
    cJSON *shape = golden_json(g, "input_shape");
    cJSON *sizes = golden_json(g, "output_sizes");
    size_t h = (size_t)cJSON_GetArrayItem(shape, 2)->valuedouble;
    size_t wide = (size_t)cJSON_GetArrayItem(shape, 3)->valuedouble;
    size_t size = (size_t)cJSON_GetArrayItem(sizes, 0)->valuedouble;

    cJSON_Delete(shape);
    cJSON_Delete(sizes);
    params_init(&ps);
    if (dino_base_init(&d, &ps, "", &vit, h, wide, size, 256, &err) ||
        params_allocate(&ps, &err) || params_allocate_gradients(&ps, &err)) {
        golden_fail(g, &err);
        return;
    }
    golden_weights_open(&w, g, NULL);
    golden_weights_fill(&ps, &w, g, "");
    float *image = golden_image("input.image", g->seed, 3, h, wide, false);
    float *rgb = layout_rows(image, 1, h * wide, 3);
    run_mode(g, &d, &ps, &w, rgb, h, wide, size, NN_INFER);
    run_mode(g, &d, &ps, &w, rgb, h, wide, size, NN_FROZEN);
    free(image);
    free(rgb);
    golden_weights_close(&w);
    dino_base_release(&d);
    params_release(&ps);
}

GOLDEN_CASE("03_dino_base", run_dino_base)
