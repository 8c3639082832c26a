/* E_m (Eqs. rot to eye): MobileNetV3 on the face crop, its mean, and six
 * linear heads. */
#include "lib/net/motion_encoder.h"

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
    nn_name(name, "%sencoder.", prefix);
    if (mobilenet_init(&m->net, ps, name, variant, err) ||
        mobilenet_copy(&m->second, &m->net, err))
        return -1;
    for (int i = 0; i < 6; i++) {
        size_t dims[2] = { heads[i].n, m->net.features };

        nn_name(name, "%s%s.weight", prefix, heads[i].name);
        m->head_w[i] = params_add(ps, name, 2, dims, PARAM_HE, 0.1f);
        nn_name(name, "%s%s.bias", prefix, heads[i].name);
        m->head_b[i] = params_add(ps, name, 1, dims, PARAM_ZERO, 0.0f);
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
    float *b = param_w(m->ps, m->head_b[0]);

    memcpy(b, rot, sizeof rot);
    param_w(m->ps, m->head_b[1])[2] = 7.0f;
    b = param_w(m->ps, m->head_b[4]);
    b[0] = b[1] = -2.0f;          /* sigmoid 0.12 */
}

int motion_encoder_plan(struct motion_encoder *m, size_t batch,
                        struct nn_options opt, struct error *err)
{
    size_t S = MOTION_ENCODER_SIZE;

    nn_plan_release(&m->plan);
    nn_plan_init(&m->plan, opt);
    m->batch = batch;
    m->pooled = nn_plan_floats(&m->plan, batch * m->net.features);
    m->dpooled = nn_plan_floats(&m->plan, batch * m->net.features);
    m->out = nn_plan_floats(&m->plan, batch * MOTION_OUT);
    m->dout = nn_plan_floats(&m->plan, batch * MOTION_OUT);
    /* more crops are for training, whose layers have work for all threads */
    m->apart = batch == 2 && opt.mode == NN_INFER;
    if (nn_plan_finish(&m->plan, err) ||
        (m->apart && mobilenet_plan(&m->second, 1, S, S, opt, err)))
        return -1;
    return mobilenet_plan(&m->net, m->apart ? 1 : batch, S, S, opt, err);
}

void motion_encoder_update(struct motion_encoder *m)
{
    mobilenet_update(&m->net);
    if (m->apart)
        mobilenet_update(&m->second);
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
    const struct nn_kernels *k = nn_kernels();
    const size_t F = m->net.features;
    float *row = m->out + n * MOTION_OUT;

    for (int i = 0; i < 6; i++)
        k->gemv(row + heads[i].at, param_w(m->ps, m->head_w[i]),
                m->pooled + n * F, param_w(m->ps, m->head_b[i]), heads[i].n, F);
    k->act_forward(row + MOTION_LID, row + MOTION_LID, ACT_SIGMOID, 2);
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

/* In the forward pass, for each head: out = W pooled + b. */
static void motion_encoder_head_backward(struct motion_encoder *m, int i)
{
    const struct nn_kernels *k = nn_kernels();
    size_t F = m->net.features;
    const float *w = param_w(m->ps, m->head_w[i]);
    float *dw = param_g(m->ps, m->head_w[i]);
    float *db = param_g(m->ps, m->head_b[i]);

    for (size_t n = 0; n < m->batch; n++)
        for (size_t o = 0; o < heads[i].n; o++) {
            float g = m->dout[n * MOTION_OUT + heads[i].at + o];

            db[o] += g;
            k->outer_backward(dw + o * F, m->dpooled + n * F, w + o * F,
                              m->pooled + n * F, g, F);
        }
}

void motion_encoder_backward(float *drgb, const float *dout,
                             struct motion_encoder *m)
{
    memcpy(m->dout, dout, m->batch * MOTION_OUT * sizeof *dout);
    for (size_t n = 0; n < m->batch; n++) {
        size_t at = n * MOTION_OUT + MOTION_LID;

        act_backward_out(m->dout + at, m->dout + at, m->out + at, ACT_SIGMOID,
                         2);
    }
    memset(m->dpooled, 0, m->batch * m->net.features * sizeof *m->dpooled);
    for (int i = 0; i < 6; i++)
        motion_encoder_head_backward(m, i);
    mobilenet_backward(drgb, m->dpooled, &m->net);
}

/* ---- as a graph ------------------------------------------------------------
 */

/* A linear head of pooled features. */
static int motion_encoder_head_graph(struct graph *g, int pooled,
                                     const struct params *ps, size_t w,
                                     size_t b)
{
    int x = GRAPH_NODE(g, "Gemm", pooled, graph_weight(g, ps, w),
                       graph_weight(g, ps, b));

    graph_set_int(g, "transB", 1);
    return x;
}

void motion_encoder_graph(struct graph *g, const struct motion_encoder *m)
{
    const size_t S = MOTION_ENCODER_SIZE;
    int picture = GRAPH_INPUT(g, "picture", 1, S, S, 3);
    int pooled = mobilenet_graph(g, graph_maps(g, picture), &m->net);
    int part[6];

    for (int i = 0; i < 6; i++) {
        part[i] = motion_encoder_head_graph(g, pooled, m->ps, m->head_w[i],
                                            m->head_b[i]);
        if (heads[i].at == MOTION_LID)
            part[i] = graph_act(g, part[i], ACT_SIGMOID);
    }
    int code = graph_node(g, "Concat", part, 6);
    graph_set_int(g, "axis", 1);
    GRAPH_OUTPUT(g, code, "code", 1, MOTION_OUT);
    if (!m->confidence.ps)
        return;
    int confidence = motion_encoder_head_graph(g, pooled, m->ps, m->confidence.w,
                                         m->confidence.b);
    GRAPH_OUTPUT(g, graph_act(g, confidence, ACT_SIGMOID), "sure", 1, 1);
}
