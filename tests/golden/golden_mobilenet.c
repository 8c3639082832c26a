/* Case 01: MobileNetV3 features, forward and backward. */
#include <stdlib.h>
#include <string.h>

#include "lib/net/mobilenet.h"
#include "tests/golden/layout.h"

static void mobilenet_compare(struct golden *g, const char *name,
                              const float *x, const size_t s[4], bool l2)
{
    layout_compare(g, name, x, s[0], s[1] * s[2], s[3], l2);
}

static void compare_stages(struct golden *g, struct mobilenet *m)
{
    static const char *const names[] = { "stage0", "stage1", "stage2",
                                         "stage3", "features" };
    size_t s[4];

    for (int i = 0; i < 5; i++) {
        const float *x = tape_map(s, &m->tape, m->stage[i]);

        mobilenet_compare(g, names[i], x, s, false);
    }
}

static void mobilenet_gradients(struct golden *g, struct mobilenet *m,
                                struct params *ps,
                                const struct golden_weights *w,
                                const size_t in[4])
{
    size_t s[4], n = in[0] * in[1] * in[2] * in[3];

    tape_map(s, &m->tape, m->stage[4]);
    float *probe = golden_probe_array(g->seed, s[0] * s[1] * s[2] * s[3]);
    float *dout = layout_rows(probe, s[0], s[1] * s[2], s[3]);
    float *drgb = malloc(n * sizeof *drgb);
    tape_backward(drgb, &(struct tape_seed){m->stage[4], dout}, 1, &m->tape);
    mobilenet_compare(g, "grad.input", drgb, in, true);
    size_t stem = params_find(ps, "conv_stem.weight");
    golden_compare_l2(g, "grad.conv_stem.weight", param_g(ps, stem),
                      ps->tensor[stem].count);
    golden_weights_gradients(g, ps, w, "");
    free(probe);
    free(dout);
    free(drgb);
}

/* Mode by mode: the folded network must give the same pooled features. */
static void run_mode(struct golden *g, struct mobilenet *m, struct params *ps,
                     const struct golden_weights *w, const float *rgb,
                     const size_t in[4], enum nn_mode mode)
{
    struct error err = { 0 };
    struct nn_options opt = { mode, NN_F32 };

    if (mobilenet_plan(m, in[0], in[1], in[2], opt, &err)) {
        golden_fail(g, &err);
        return;
    }
    float *pooled = malloc(in[0] * m->features * sizeof *pooled);
    mobilenet_forward(pooled, rgb, m);
    golden_compare(g, "pooled", pooled, in[0] * m->features);
    free(pooled);
    if (mode != NN_FROZEN)
        return;
    compare_stages(g, m);
    mobilenet_gradients(g, m, ps, w, in);
}

static void run_mobilenet(struct golden *g)
{
    struct mobilenet m;
    struct params ps;
    struct golden_weights w;
    struct error err = { 0 };
    size_t in[4];

    golden_input_shape(in, g);
    params_init(&ps);
    if (mobilenet_init(&m, &ps, "", golden_meta(g, "network"), &err) ||
        params_allocate(&ps, &err) || params_allocate_gradients(&ps, &err)) {
        golden_fail(g, &err);
        return;
    }
    golden_weights_open(&w, g, NULL);
    golden_weights_fill(&ps, &w, g, "");
    float *image = golden_image("input.image", g->seed, in[0] * in[3], in[1],
                                in[2], false);
    float *rgb = layout_rows(image, in[0], in[1] * in[2], in[3]);
    run_mode(g, &m, &ps, &w, rgb, in, NN_INFER);
    run_mode(g, &m, &ps, &w, rgb, in, NN_FROZEN);
    free(image);
    free(rgb);
    golden_weights_close(&w);
    mobilenet_release(&m);
    params_release(&ps);
}

GOLDEN_CASE("01_mobilenet", run_mobilenet)
