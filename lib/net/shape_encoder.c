/* E_beta (Eq. beta): MobileNetV3 on the face crop and one linear layer. */
#include "lib/net/shape_encoder.h"

#include <string.h>

#include "lib/nn/conv.h"

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
    nn_name(name, "%sshape", prefix);
    dense_init(&s->head, ps, name, s->net.features, SHAPE_ENCODER_OUT, 0.1f);
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
        dense_forward(beta + n * SHAPE_ENCODER_OUT, s->pooled + n * F,
                      &s->head);
}

void shape_encoder_backward(float *drgb, const float *dbeta,
                            struct shape_encoder *s)
{
    size_t F = s->net.features;

    memset(s->dpooled, 0, s->batch * F * sizeof *s->dpooled);
    for (size_t n = 0; n < s->batch; n++)
        dense_backward(s->dpooled + n * F, dbeta + n * SHAPE_ENCODER_OUT,
                       s->pooled + n * F, &s->head);
    mobilenet_backward(drgb, s->dpooled, &s->net);
}

/* ---- as a graph ---------------------------------------------------------- */

void shape_encoder_graph(struct graph *g, const struct shape_encoder *s)
{
    const size_t S = SHAPE_ENCODER_SIZE;
    int picture = GRAPH_INPUT(g, "picture", 1, S, S, 3);
    int pooled = mobilenet_graph(g, picture, &s->net);
    GRAPH_OUTPUT(g, graph_dense(g, pooled, &s->head), "shape", 1,
                 SHAPE_ENCODER_OUT);
}
