/* Case 02: the vision transformer, forward. */
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

static void compare_all(struct golden *g, const struct dinov2 *d)
{
    char name[32];
    size_t E = EMBED;

    golden_compare(g, "pos_embed_resized", dinov2_position(d), d->tokens * E);
    for (size_t k = 0; k < 4; k++) {
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

static void run_dinov2_vit(struct golden *g)
{
    struct dinov2 d;
    struct params ps;
    struct golden_weights w;
    struct error err = { 0 };
    struct dinov2_config config = { EMBED, 4, 3, 14, 37, 4 };
    size_t in[4];

    golden_input_shape(in, g);
    params_init(&ps);
    if (dinov2_init(&d, &ps, "", &config, true, &err) ||
        params_allocate(&ps, &err)) {
        golden_fail(g, &err);
        return;
    }
    golden_weights_open(&w, g, NULL);
    golden_weights_fill(&ps, &w, g, "");
    float *image = golden_image("input.image", g->seed, in[0] * in[3], in[1],
                                in[2], true);
    float *rgb = layout_rows(image, in[0], in[1] * in[2], in[3]);
    if (dinov2_plan(&d, in[0], in[1], in[2], NN_F32, &err)) {
        golden_fail(g, &err);
    } else {
        dinov2_forward(rgb, &d);
        compare_all(g, &d);
    }
    free(image);
    free(rgb);
    golden_weights_close(&w);
    dinov2_release(&d);
    params_release(&ps);
}

GOLDEN_CASE("02_dinov2_vit", run_dinov2_vit)
