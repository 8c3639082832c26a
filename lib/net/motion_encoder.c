/* E_m (Eqs. rot to eye): MobileNetV3 on the face crop, its mean, and six
 * linear heads. */
#include "lib/net/motion_encoder.h"

#include <stdio.h>
#include <string.h>

#include "lib/base/parallel.h"
#include "lib/nn/conv.h"
#include "lib/nn/kernels.h"

static const struct {
    const char *name;
    size_t at, n;
} heads[6] = {
    { "rot", MOTION_ROT, 6 },   { "trans", MOTION_TRANS, 3 },
    { "exp", MOTION_EXP, 100 }, { "jaw", MOTION_JAW, 3 },
    { "lid", MOTION_LID, 2 },   { "eye", MOTION_EYE, 6 }
};

int motion_encoder_init(struct motion_encoder *m, struct params *ps,
                        const char *prefix, const char *variant,
                        struct error *err)
{
    char name[120];

    memset(m, 0, sizeof *m);
    m->ps = ps;
    snprintf(m->prefix, sizeof m->prefix, "%s", prefix);
    if (mobilenet_init(&m->net, ps, nn_name(name, "%sencoder.", prefix),
                       variant, err))
        return -1;
    for (int i = 0; i < 6; i++) {
        nn_name(name, "%s%s", prefix, heads[i].name);
        dense_init(&m->head[i], ps, name, m->net.features, heads[i].n, 0.1f);
    }
    return 0;
}

void motion_encoder_add_confidence(struct motion_encoder *m, const char *prefix)
{
    confidence_head_init(&m->confidence, m->ps, prefix, m->net.features);
}

void motion_encoder_add_rest(struct motion_encoder *m, const char *prefix)
{
    const size_t dims[2] = {2, MOTION_OUT};
    char name[120];

    nn_name(name, "%srest", prefix);
    m->rest = params_add(m->ps, name, 2, dims, PARAM_ZERO, 0);
    m->has_rest = true;
}

const float *motion_encoder_rest(const struct motion_encoder *m)
{
    return m->has_rest ? param_w(m->ps, m->rest) : NULL;
}

float motion_encoder_confidence(const struct motion_encoder *m, size_t n)
{
    return confidence_head_forward(&m->confidence,
                                   m->pooled + n * m->net.features);
}

void motion_encoder_init_weights(struct motion_encoder *m)
{
    static const float rot[6] = { 1, 0, 0, 0, -1, 0 };
    float *b = param_w(m->ps, m->head[0].bias);

    memcpy(b, rot, sizeof rot);
    param_w(m->ps, m->head[1].bias)[2] = 7;
    b = param_w(m->ps, m->head[4].bias);
    b[0] = b[1] = -2.0f;          /* sigmoid 0.12 */
}

int motion_encoder_plan(struct motion_encoder *m, size_t batch,
                        struct nn_options opt, struct error *err)
{
    size_t S = MOTION_ENCODER_SIZE;
    char name[120];

    nn_plan_release(&m->plan);
    nn_plan_init(&m->plan, opt);
    m->batch = batch;
    m->pooled = nn_plan_floats(&m->plan, batch * m->net.features);
    m->dpooled = nn_plan_floats(&m->plan, batch * m->net.features);
    m->out = nn_plan_floats(&m->plan, batch * MOTION_OUT);
    m->dout = nn_plan_floats(&m->plan, batch * MOTION_OUT);
    /* more crops are for training, whose layers have work for all threads */
    m->apart = batch == 2 && opt.mode == NN_INFER;
    if (nn_plan_finish(&m->plan, err))
        return -1;
    if (m->apart && !m->second.variant &&
        mobilenet_init(&m->second, m->ps, nn_name(name, "%sencoder.", m->prefix),
                       m->net.variant, err))
        return -1;
    if (m->apart && mobilenet_plan(&m->second, 1, S, S, opt, err))
        return -1;
    return mobilenet_plan(&m->net, m->apart ? 1 : batch, S, S, opt, err);
}

void motion_encoder_release(struct motion_encoder *m)
{
    mobilenet_release(&m->net);
    mobilenet_release(&m->second);
    nn_plan_release(&m->plan);
    memset(m, 0, sizeof *m);
}

/* Of two crops, crop n's features. */
PARALLEL(motion_encoder_crop, n, struct motion_encoder *, m, const float *, rgb)
{
    mobilenet_forward(m->pooled + n * m->net.features,
                      rgb + n * 3 * MOTION_ENCODER_SIZE * MOTION_ENCODER_SIZE,
                      n ? &m->second : &m->net);
}

/* Row n of m->out from crop n's features. */
static void motion_encoder_heads(struct motion_encoder *m, size_t n)
{
    const float *pooled = m->pooled + n * m->net.features;
    float *row = m->out + n * MOTION_OUT;

    for (int i = 0; i < 6; i++)
        dense_forward(row + heads[i].at, pooled, &m->head[i]);
    nn_kernels()->act_forward(row + MOTION_LID, row + MOTION_LID, ACT_SIGMOID,
                              2);
}

void motion_encoder_forward(float *out, const float *rgb,
                            struct motion_encoder *m)
{
    if (m->apart)
        parallel_each(motion_encoder_crop, 2, 1, m, rgb);
    else
        mobilenet_forward(m->pooled, rgb, &m->net);
    for (size_t n = 0; n < m->batch; n++)
        motion_encoder_heads(m, n);
    memcpy(out, m->out, m->batch * MOTION_OUT * sizeof *out);
}

void motion_encoder_forward_one(float *out, const float *rgb, size_t n,
                                struct motion_encoder *m)
{
    mobilenet_forward(m->pooled + n * m->net.features, rgb,
                      n ? &m->second : &m->net);
    motion_encoder_heads(m, n);
    memcpy(out, m->out + n * MOTION_OUT, MOTION_OUT * sizeof *out);
}

void motion_encoder_backward(float *drgb, const float *dout,
                             struct motion_encoder *m)
{
    memcpy(m->dout, dout, m->batch * MOTION_OUT * sizeof *dout);
    memset(m->dpooled, 0, m->batch * m->net.features * sizeof *m->dpooled);
    for (size_t n = 0; n < m->batch; n++) {
        const size_t at = n * m->net.features, lid = n * MOTION_OUT + MOTION_LID;

        act_backward_out(m->dout + lid, m->dout + lid, m->out + lid,
                         ACT_SIGMOID, 2);
        for (int i = 0; i < 6; i++)
            dense_backward(m->dpooled + at,
                           m->dout + n * MOTION_OUT + heads[i].at,
                           m->pooled + at, &m->head[i]);
    }
    mobilenet_backward(drgb, m->dpooled, &m->net);
}

/* ---- as a graph ---------------------------------------------------------- */

void motion_encoder_graph(struct graph *g, const struct motion_encoder *m)
{
    const size_t S = MOTION_ENCODER_SIZE;
    int picture = GRAPH_INPUT(g, "picture", 1, S, S, 3);
    int pooled = mobilenet_graph(g, picture, &m->net);
    int part[6];

    for (int i = 0; i < 6; i++) {
        part[i] = graph_dense(g, pooled, &m->head[i]);
        if (heads[i].at == MOTION_LID)
            part[i] = graph_act(g, part[i], ACT_SIGMOID);
    }
    int code = graph_node(g, "Concat", part, 6);
    graph_set_int(g, "axis", 1);
    GRAPH_OUTPUT(g, code, "code", 1, MOTION_OUT);
    if (!m->confidence.ps)
        return;
    int confidence = graph_dense(g, pooled, &m->confidence);
    GRAPH_OUTPUT(g, graph_act(g, confidence, ACT_SIGMOID), "sure", 1, 1);
}
