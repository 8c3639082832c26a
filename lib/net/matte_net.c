/* The matte network: a U-Net (Ronneberger et al. 2015) with one logit for
 * every pixel. */
#include "lib/net/matte_net.h"

#include <math.h>

void matte_net_init(struct matte_net *m, struct params *ps,
                    const char *prefix, size_t side, size_t width)
{
    struct tape *t = &m->net.tape;

    m->side = side;
    small_backbone_init(&m->net, ps, prefix, 4, side / 2, width);
    tape_to_space(t, t->count - 1, 2);
}

int matte_net_plan(struct matte_net *m, size_t batch, struct nn_options opt,
                   struct error *err)
{
    return small_backbone_plan(&m->net, batch, m->side, opt, err);
}

void matte_net_release(struct matte_net *m)
{
    small_backbone_release(&m->net);
}

void matte_net_forward(float *logit, const float *rgb, struct matte_net *m)
{
    tape_forward(logit, rgb, &m->net.tape);
}

void matte_net_backward(const float *dlogit, struct matte_net *m)
{
    struct tape *t = &m->net.tape;

    tape_backward(NULL, &(struct tape_seed){t->count - 1, dlogit}, 1, t);
}

double matte_net_alpha(float logit)
{
    return 1 / (1 + exp(-(double)logit));
}

double matte_net_loss(float *dlogit, const float *logit, const float *alpha,
                      const float *weight, double scale, size_t n)
{
    double sum = 0, each = scale / (double)n;

    for (size_t i = 0; i < n; i++) {
        double z = (double)logit[i], a = (double)alpha[i];
        double w = each * (double)weight[i];

        sum += w * (fmax(z, 0) - z * a + log1p(exp(-fabs(z))));
        dlogit[i] = (float)(w * (matte_net_alpha(logit[i]) - a));
    }
    return sum;
}

/* ---- as a graph ---------------------------------------------------------- */

void matte_net_graph(struct graph *g, const struct matte_net *m)
{
    const size_t S = m->side;
    int picture = GRAPH_INPUT(g, "picture", 1, S, S, 3);
    int x = small_backbone_graph(g, picture, S, &m->net);

    x = graph_act(g, x, ACT_SIGMOID);
    GRAPH_OUTPUT(g, graph_rows(g, x), "alpha", 1, S, S, 1);
}
