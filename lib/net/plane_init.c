/* Phi_init (Eq. for Delta U): how far the cells of the static plane move. */
#include "lib/net/plane_init.h"

void plane_init_init(struct plane_init *p, struct params *ps,
                     const char *prefix, size_t in, size_t width)
{
    struct tape *t = &p->tape;
    char name[120];
    int x = 0;

    tape_init(t, ps, in, false);
    p->width = width;
    for (int i = 0; i < 3; i++) {
        nn_name(name, "%s%d", prefix, 2 * i);
        x = tape_conv(t, x, name, i < 2 ? width : 2, 3, true);
        struct conv *c = tape_layer(t, x);
        ps->tensor[c->weight].gain = 1.4142135f;
        if (i == 2) {
            ps->tensor[c->weight].init = PARAM_ZERO;
            break;
        }
        c->act = ACT_RELU;
        tape_halve_map(t, x);
    }
    tape_scale(t, tape_act(t, x, ACT_TANH), PLANE_INIT_MAX);
}

int plane_init_plan(struct plane_init *p, size_t height, size_t width,
                    struct nn_options opt, struct error *err)
{
    return tape_plan(&p->tape, 1, height, width, opt, err);
}

void plane_init_release(struct plane_init *p)
{
    tape_release(&p->tape);
    p->width = 0;
}

void plane_init_forward(float *delta, const float *in, struct plane_init *p)
{
    tape_forward(delta, in, &p->tape);
}

void plane_init_backward(float *din, const float *ddelta,
                         struct plane_init *p)
{
    tape_backward(din, &(struct tape_seed){p->tape.count - 1, ddelta}, 1,
                  &p->tape);
}

/* ---- as a graph ---------------------------------------------------------- */

void plane_init_graph(struct graph *g, size_t n, const struct plane_init *p)
{
    const size_t in = p->tape.picture.channels;
    int x = graph_maps(g, GRAPH_INPUT(g, "features", 1, n, n, in));

    x = tape_graph(g, x, 0, p->tape.count - 1, &p->tape);
    GRAPH_OUTPUT(g, graph_rows(g, x), "delta", 1, n, n, 2);
}
