/* Case 03: the fusion head on a reduced transformer. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/net/dino_base.h"
#include "tests/golden/golden_net.h"

static void dino_base_compare_stages(struct golden *g,
                                     const struct dino_base *d)
{
    static const struct {
        const char *name;
        enum dino_stage stage;
    } kinds[3] = { { "cat", DINO_CAT }, { "layer_rn", DINO_RN },
                   { "refine", DINO_REFINE } };
    char name[32];
    size_t s[4];

    for (size_t k = 0; k < DINO_LEVELS; k++)
        for (int i = 0; i < 3; i++) {
            const float *x = dino_base_stage(s, d, kinds[i].stage, k);
            size_t C = i ? s[3] : d->level[k].channels + 3;
            /* cat is stored with its channels padded */
            float *tight = malloc(s[0] * s[1] * s[2] * C * sizeof *tight);

            for (size_t r = 0; r < s[0] * s[1] * s[2]; r++)
                memcpy(tight + r * C, x + r * s[3], C * sizeof *tight);
            snprintf(name, sizeof name, "%s%zu", kinds[i].name, k);
            layout_compare(g, name, tight, s[0], s[1] * s[2], C, false);
            free(tight);
        }
}

/* sum(feature probe), back to the head's weights. */
static void dino_base_gradients(struct golden_net *n, struct dino_base *d)
{
    static const char *const names[] = {
        "projects.0.weight", "resize_layers.0.weight", "resize_layers.3.bias",
        "layer_rn.2.weight", "refinenet.3.resConfUnit1.conv1.weight",
        "output_conv.bias"
    };
    struct golden *g = n->g;
    size_t s[4];

    dino_base_stage(s, d, DINO_FEATURE, 0);
    float *probe = golden_probe_array(g->seed, s[0] * s[1] * s[2] * s[3]);
    float *dout = layout_rows(probe, s[0], s[1] * s[2], s[3]);
    bool resize = d->resize_out;
    d->resize_out = false;        /* the loss is of `feature` itself */
    dino_base_backward(dout, d);
    d->resize_out = resize;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        golden_net_gradient(g, &n->ps, names[i], true);
    golden_weights_gradients(g, &n->ps, &n->w, "");
    free(probe);
    free(dout);
}

/* Inference as it is used, or everything in float. */
static void dino_base_run_mode(struct golden_net *n, struct dino_base *d,
                               size_t size, enum nn_mode mode)
{
    struct nn_options opt = { mode, mode == NN_INFER ? NN_FAST : NN_F32 };
    struct golden *g = n->g;
    struct error err = { 0 };
    size_t h = n->in[1], w = n->in[2], s[4];
    char name[32];

    if (golden_failed(g, dino_base_plan(d, 1, h, w, h, w, size, opt, &err),
                      &err))
        return;
    size_t E = d->vit.config.embed, count = size * size * d->out;
    float *features = malloc(count * sizeof *features);
    dino_base_forward(features, n->rgb, d);
    snprintf(name, sizeof name, "feature_size%zu", size);
    layout_compare(g, name, features, 1, size * size, d->out, false);
    if (mode != NN_INFER) {
        golden_compare(g, "global", dinov2_tokens(&d->vit, 3) + E, E);
        dino_base_compare_stages(g, d);
        const float *x = dino_base_stage(s, d, DINO_FEATURE, 0);
        layout_compare(g, "feature", d->resize_out ? x : features, 1,
                       s[1] * s[2], s[3], false);
        if (golden_has(g, "grad.output_conv.bias"))
            dino_base_gradients(n, d);
    }
    free(features);
}

static void dino_base_run(struct golden *g)
{
    struct dinov2_config vit = { 96, 4, 3, 14, 37, 4 };
    struct dino_base d;
    struct golden_net n;
    struct error err = { 0 };
    cJSON *sizes = golden_json(g, "output_sizes");
    size_t size = (size_t)cJSON_GetArrayItem(sizes, 0)->valuedouble;

    cJSON_Delete(sizes);
    golden_net_begin(&n, g);
    int rc = dino_base_init(&d, &n.ps, "", &vit, 256, &err);
    if (!golden_net_ready(&n, rc, false, &err))
        return;
    dino_base_run_mode(&n, &d, size, NN_INFER);
    dino_base_run_mode(&n, &d, size, NN_FROZEN);
    golden_net_end(&n);
    dino_base_release(&d);
}

GOLDEN_CASE("03_dino_base", dino_base_run)
