/* Case 01: MobileNetV3 features, forward and backward. */
#include <stdlib.h>

#include "lib/net/mobilenet.h"
#include "tests/golden/golden_net.h"

/* A map (B,h,w,C) of shape s. */
static void mobilenet_compare(struct golden *g, const char *name,
                              const float *x, const size_t s[4], bool l2)
{
    layout_compare(g, name, x, s[0], s[1] * s[2], s[3], l2);
}

static void mobilenet_compare_stages(struct golden *g, struct mobilenet *m)
{
    static const char *const names[] = { "stage0", "stage1", "stage2",
                                         "stage3", "features" };
    size_t s[4];

    for (int i = 0; i < 5; i++) {
        const float *x = mobilenet_stage(s, m, i);

        mobilenet_compare(g, names[i], x, s, false);
    }
}

/* sum(features probe), back to the picture and the weights. */
static void mobilenet_gradients(struct golden_net *n, struct mobilenet *m)
{
    struct golden *g = n->g;
    const size_t *in = n->in;
    size_t s[4];

    mobilenet_stage(s, m, 4);
    float *probe = golden_probe_array(g->seed, s[0] * s[1] * s[2] * s[3]);
    float *dout = layout_rows(probe, s[0], s[1] * s[2], s[3]);
    float *drgb = malloc(in[0] * in[1] * in[2] * in[3] * sizeof *drgb);
    mobilenet_backward_features(drgb, dout, m);
    mobilenet_compare(g, "grad.input", drgb, in, true);
    golden_net_gradient(g, &n->ps, "conv_stem.weight", true);
    golden_weights_gradients(g, &n->ps, &n->w, "");
    free(probe);
    free(dout);
    free(drgb);
}

/* Mode by mode: the folded network must give the same pooled features. */
static void mobilenet_run_mode(struct golden_net *n, struct mobilenet *m,
                               enum nn_mode mode)
{
    struct error err = { 0 };
    struct nn_options opt = { mode, NN_F32 };
    const size_t *in = n->in;

    if (golden_failed(n->g, mobilenet_plan(m, in[0], in[1], in[2], opt, &err),
                      &err))
        return;
    float *pooled = malloc(in[0] * m->features * sizeof *pooled);
    mobilenet_forward(pooled, n->rgb, m);
    golden_compare(n->g, "pooled", pooled, in[0] * m->features);
    free(pooled);
    if (mode != NN_FROZEN)
        return;
    mobilenet_compare_stages(n->g, m);
    mobilenet_gradients(n, m);
}

static void mobilenet_run(struct golden *g)
{
    struct mobilenet m;
    struct golden_net n;
    struct error err = { 0 };

    golden_net_begin(&n, g);
    int rc = mobilenet_init(&m, &n.ps, "", golden_meta(g, "network"), &err);
    if (!golden_net_ready(&n, rc, false, &err))
        return;
    mobilenet_run_mode(&n, &m, NN_INFER);
    mobilenet_run_mode(&n, &m, NN_FROZEN);
    golden_net_end(&n);
    mobilenet_release(&m);
}

GOLDEN_CASE("01_mobilenet", mobilenet_run)
