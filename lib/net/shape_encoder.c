/* E_beta (Eq. beta): MobileNetV3 on the face crop and one linear layer. */
#include "lib/net/shape_encoder.h"

#include <string.h>

#include "lib/nn/conv.h"
#include "lib/nn/kernels.h"

int shape_encoder_init(struct shape_encoder *s, struct params *ps,
                       const char *prefix, const char *variant,
                       struct error *err)
{
    char name[120];

    memset(s, 0, sizeof *s);
    s->ps = ps;
    nn_name(name, "%sencoder.", prefix);
    if (mobilenet_init(&s->net, ps, name, variant, err))
        return -1;
    size_t dims[2] = { SHAPE_ENCODER_OUT, s->net.features };
    nn_name(name, "%sshape.weight", prefix);
    s->weight = params_add(ps, name, 2, dims, PARAM_HE, 0.1f);
    nn_name(name, "%sshape.bias", prefix);
    s->bias = params_add(ps, name, 1, dims, PARAM_ZERO, 0.0f);
    return 0;
}

int shape_encoder_plan(struct shape_encoder *s, size_t batch,
                       struct nn_options opt, struct error *err)
{
    size_t S = SHAPE_ENCODER_SIZE;

    nn_plan_release(&s->plan);
    nn_plan_init(&s->plan, opt);
    s->batch = batch;
    s->pooled = nn_plan_floats(&s->plan, batch * s->net.features);
    s->dpooled = nn_plan_floats(&s->plan, batch * s->net.features);
    if (nn_plan_finish(&s->plan, err))
        return -1;
    return mobilenet_plan(&s->net, batch, S, S, opt, err);
}

void shape_encoder_update(struct shape_encoder *s)
{
    mobilenet_update(&s->net);
}

void shape_encoder_release(struct shape_encoder *s)
{
    mobilenet_release(&s->net);
    nn_plan_release(&s->plan);
    memset(s, 0, sizeof *s);
}

void shape_encoder_forward(float *beta, const float *rgb,
                           struct shape_encoder *s)
{
    size_t F = s->net.features;

    mobilenet_forward(s->pooled, rgb, &s->net);
    for (size_t n = 0; n < s->batch; n++)
        nn_kernels()->gemv(beta + n * SHAPE_ENCODER_OUT,
                           param_w(s->ps, s->weight), s->pooled + n * F,
                           param_w(s->ps, s->bias), SHAPE_ENCODER_OUT, F);
}

/* In the forward pass: beta = W pooled + b. */
void shape_encoder_backward(float *drgb, const float *dbeta,
                            struct shape_encoder *s)
{
    size_t F = s->net.features;
    const float *w = param_w(s->ps, s->weight);
    float *dw = param_g(s->ps, s->weight), *db = param_g(s->ps, s->bias);

    memset(s->dpooled, 0, s->batch * F * sizeof *s->dpooled);
    for (size_t n = 0; n < s->batch; n++)
        for (size_t o = 0; o < SHAPE_ENCODER_OUT; o++) {
            float g = dbeta[n * SHAPE_ENCODER_OUT + o];

            db[o] += g;
            for (size_t f = 0; f < F; f++) {
                dw[o * F + f] += g * s->pooled[n * F + f];
                s->dpooled[n * F + f] += g * w[o * F + f];
            }
        }
    mobilenet_backward(drgb, s->dpooled, &s->net);
}

/* ---- as a graph ------------------------------------------------------------
 */

void shape_encoder_graph(struct graph *g, const struct shape_encoder *s)
{
    const size_t S = SHAPE_ENCODER_SIZE;
    int picture = GRAPH_INPUT(g, "picture", 1, S, S, 3);
    int pooled = mobilenet_graph(g, graph_maps(g, picture), &s->net);
    int beta = GRAPH_NODE(g, "Gemm", pooled, graph_weight(g, s->ps, s->weight),
                          graph_weight(g, s->ps, s->bias));

    graph_set_int(g, "transB", 1);
    GRAPH_OUTPUT(g, beta, "shape", 1, SHAPE_ENCODER_OUT);
}
