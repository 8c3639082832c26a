/* Phi_D (Section 3.2): a shared trunk over the points, then a small head for
 * each attribute. */
#include "lib/net/mlp_decoder.h"

#include <string.h>

#include "lib/net/harmonic.h"
#include "lib/nn/image.h"

#define ATTRIBUTES 4

static const char *const attribute[ATTRIBUTES] = { "color", "opacity", "scale",
                                                   "rotation" };

/* ---- its own step: gamma behind every point's numbers ------------------------- */

struct mlp_gamma {
    float *gamma, *dgamma;       /* (B,27) */
};

/* In memory a multiple of 16, the rest zero. */
static void mlp_gamma_plan(struct tape_step *s, struct nn_plan *p)
{
    struct mlp_gamma *l = s->layer;

    s->channels = (s->of[0]->channels + HARMONIC_OUT + 15) / 16 * 16;
    l->gamma = nn_plan_floats(p, s->batch * HARMONIC_OUT);
    if (nn_plan_backward(p))
        l->dgamma = nn_plan_floats(p, s->batch * HARMONIC_OUT);
}

static void mlp_gamma_forward(struct tape_step *s)
{
    const struct mlp_gamma *l = s->layer;

    concat_forward(s->out, s->of[0]->x, l->gamma, s->batch * s->h,
                   s->of[0]->channels, HARMONIC_OUT, s->channels, s->h);
}

static void mlp_gamma_backward(float *to, struct tape_step *s, int k)
{
    const struct mlp_gamma *l = s->layer;

    memset(l->dgamma, 0, s->batch * HARMONIC_OUT * sizeof *l->dgamma);
    concat_backward(to, l->dgamma, s->d, s->batch * s->h, s->of[k]->channels,
                    HARMONIC_OUT, s->channels, s->h);
}

static const struct tape_op gamma_op = {
    sizeof(struct mlp_gamma), 0, false, mlp_gamma_plan, mlp_gamma_forward,
    mlp_gamma_backward, NULL
};

/* ---- the network ---------------------------------------------------------------- */

/* Numbers of attribute i. */
static size_t mlp_decoder_width(const struct mlp_decoder *d, int i)
{
    return i == 0 ? d->head.colors : i == 1 ? 1 : i == 2 ? 3 : 4;
}

/* A linear layer, its act and its weights' gain. */
static int mlp_decoder_linear(struct mlp_decoder *d, int x, const char *name,
                              size_t out, enum nn_act act, float gain)
{
    const int map = tape_linear(&d->tape, x, name, out);
    struct conv *c = tape_layer(&d->tape, map);

    c->act = act;
    c->ps->tensor[c->weight].gain = gain;
    return map;
}

/* Attribute i of the map of points with gamma. */
static int mlp_decoder_attribute(struct mlp_decoder *d, int x, int i,
                                 size_t hidden, const char *prefix)
{
    const size_t in = tape_channels(&d->tape, x);
    char name[120];

    nn_name(name, "%s%s_layers.0", prefix, attribute[i]);
    x = mlp_decoder_linear(d, x, name, hidden, ACT_RELU, 1.4142135f);
    tape_layer(&d->tape, x)->in_data = (in + 15) / 16 * 16;
    nn_name(name, "%s%s_layers.2", prefix, attribute[i]);
    return mlp_decoder_linear(d, x, name, mlp_decoder_width(d, i), ACT_NONE,
                              0.3f);
}

void mlp_decoder_init(struct mlp_decoder *d, struct params *ps,
                      const char *prefix, size_t in, size_t width,
                      size_t hidden, struct gaussian_head head)
{
    const int heads = head.colors_only ? 1 : ATTRIBUTES;
    char name[120];
    int x = 0, raw;

    memset(d, 0, sizeof *d);
    d->head = head;
    tape_init(&d->tape, ps, in, false);
    for (int i = 0; i < 4; i++) {
        nn_name(name, "%sfeature_layers.%d", prefix, 2 * i);
        x = mlp_decoder_linear(d, x, name, width, i < 3 ? ACT_RELU : ACT_NONE,
                               i < 3 ? 1.4142135f : 1);
    }
    d->trunk = x;
    d->gamma = x = TAPE_STEP(&d->tape, &gamma_op, x);
    d->tape.map[x]->channels = width + HARMONIC_OUT;
    raw = mlp_decoder_attribute(d, x, 0, hidden, prefix);
    for (int i = 1; i < heads; i++)
        raw = tape_concat(&d->tape, raw,
                          mlp_decoder_attribute(d, x, i, hidden, prefix));
}

int mlp_decoder_plan(struct mlp_decoder *d, size_t batch, size_t points,
                     struct nn_options opt, struct error *err)
{
    return tape_plan(&d->tape, batch, points, 1, opt, err);
}

void mlp_decoder_release(struct mlp_decoder *d)
{
    tape_release(&d->tape);
    memset(d, 0, sizeof *d);
}

/* The map of all attributes' raw numbers, (B,N,width of the head). */
static const struct tape_step *mlp_decoder_raw(const struct mlp_decoder *d)
{
    return d->tape.map[d->tape.count - 1];
}

void mlp_decoder_forward(struct gaussian_out *out, const float *features,
                         const float *dir, const float *rgb_logit,
                         struct mlp_decoder *d)
{
    const struct tape_step *raw = mlp_decoder_raw(d);
    const struct mlp_gamma *l = d->tape.map[d->gamma]->layer;

    harmonic_forward(l->gamma, dir, raw->batch);
    tape_forward(NULL, features, &d->tape);
    gaussian_head_forward(out, raw->x, rgb_logit, &d->head, raw->batch, raw->h,
                          raw->channels, raw->h);
}

void mlp_decoder_backward(float *dfeatures, float *ddir,
                          const struct gaussian_out *dout, const float *dir,
                          const float *rgb_logit, struct mlp_decoder *d)
{
    const struct tape_step *raw = mlp_decoder_raw(d);
    const struct mlp_gamma *l = d->tape.map[d->gamma]->layer;

    gaussian_head_backward(raw->d, NULL, dout, raw->x, rgb_logit, &d->head,
                           raw->batch, raw->h, raw->channels, raw->h);
    tape_backward(dfeatures, &(struct tape_seed){d->tape.count - 1, raw->d}, 1,
                  &d->tape);
    if (!ddir)
        return;
    memset(ddir, 0, 3 * raw->batch * sizeof *ddir);
    harmonic_backward(ddir, l->dgamma, dir, raw->batch);
}

/* ---- as a graph ---------------------------------------------------------- */

void mlp_decoder_graph(struct graph *g, size_t N,
                       const struct mlp_decoder *d)
{
    const struct tape *t = &d->tape;
    int x = GRAPH_INPUT(g, "features", N, t->picture.channels);
    int gamma = harmonic_graph(g, GRAPH_INPUT(g, "direction", 1, 3));
    int logit = GRAPH_INPUT(g, "rgb_logit", N, 3);

    x = tape_graph(g, x, 0, d->trunk, t);
    gamma = GRAPH_NODE(g, "Expand", gamma,
                       GRAPH_INTS(g, (int64_t)N, HARMONIC_OUT));
    x = tape_graph(g, graph_concat(g, x, gamma), d->gamma, t->count - 1, t);
    gaussian_head_graph(g, x, logit, N, &d->head);
}
