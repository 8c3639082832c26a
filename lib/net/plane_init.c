/* Phi_init (Eq. for Delta U): how far the cells of the static plane move. */
#include "lib/net/plane_init.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/nn/conv.h"

struct plane_init_impl {
    struct nn_plan plan;
    struct conv conv[3];
    const float *in;
    void *y[2];                  /* hidden layers, bfloat16 where they may be */
    float *t;                    /* tanh's output */
    float *grad[2], *dt;
};

int plane_init_init(struct plane_init *p, struct params *ps,
                    const char *prefix, size_t in, size_t width,
                    struct error *err)
{
    char name[120];

    memset(p, 0, sizeof *p);
    p->impl = calloc(1, sizeof *p->impl);
    if (!p->impl)
        return error_set(err, EX_OSERR, "out of memory");
    p->in = in;
    p->width = width;
    for (int i = 0; i < 3; i++) {
        struct conv *c = &p->impl->conv[i];

        conv_init(c, ps, nn_name(name, "%s%d", prefix, 2 * i),
                  i ? width : in, i < 2 ? width : 2, 3, 1, true);
        c->act = i < 2 ? ACT_RELU : ACT_NONE;
        ps->tensor[c->weight].gain = 1.4142135f;
        if (i == 2)
            ps->tensor[c->weight].init = PARAM_ZERO;
    }
    return 0;
}

int plane_init_plan(struct plane_init *p, size_t height, size_t width,
                    struct nn_options opt, struct error *err)
{
    struct plane_init_impl *im = p->impl;
    struct nn_plan *pl = &im->plan;
    size_t pixels = height * width;

    nn_plan_release(pl);
    nn_plan_init(pl, opt);
    p->height = height;
    p->image_w = width;
    for (int i = 0; i < 3; i++) {
        float *y = nn_plan_map(pl, pixels * (i < 2 ? p->width : 2));

        if (i < 2)
            im->y[i] = y;
        else
            im->t = y;
        im->conv[i].half_in = i > 0 && conv_halves(pl);
        im->conv[i].half_out = i < 2 && conv_halves(pl);
        conv_plan(&im->conv[i], pl, 1, height, width);
    }
    if (nn_plan_backward(pl)) {
        im->dt = nn_plan_floats(pl, pixels * 2);
        im->grad[0] = nn_plan_floats(pl, pixels * p->width);
        im->grad[1] = nn_plan_floats(pl, pixels * p->width);
    }
    return nn_plan_finish(pl, err);
}

void plane_init_release(struct plane_init *p)
{
    if (!p->impl)
        return;
    nn_plan_release(&p->impl->plan);
    free(p->impl);
    memset(p, 0, sizeof *p);
}

void plane_init_forward(float *delta, const float *in, struct plane_init *p)
{
    struct plane_init_impl *im = p->impl;
    size_t n = p->height * p->image_w * 2;

    im->in = in;
    conv_forward(im->y[0], in, &im->conv[0]);
    conv_forward(im->y[1], im->y[0], &im->conv[1]);
    conv_forward(im->t, im->y[1], &im->conv[2]);
    act_forward(im->t, im->t, ACT_TANH, n);
    for (size_t i = 0; i < n; i++)
        delta[i] = im->t[i] * PLANE_INIT_MAX;
}

void plane_init_backward(float *din, const float *ddelta,
                         struct plane_init *p)
{
    struct plane_init_impl *im = p->impl;
    size_t n = p->height * p->image_w * 2;

    for (size_t i = 0; i < n; i++)
        im->dt[i] = ddelta[i] * PLANE_INIT_MAX;
    act_backward_out(im->dt, im->dt, im->t, ACT_TANH, n);
    conv_backward(im->grad[0], im->dt, im->t, im->y[1], &im->conv[2]);
    conv_backward(im->grad[1], im->grad[0], im->y[1], im->y[0], &im->conv[1]);
    conv_backward(din, im->grad[1], im->y[0], im->in, &im->conv[0]);
}

/* ---- as a graph ---------------------------------------------------------- */

void plane_init_graph(struct graph *g, size_t n, const struct plane_init *p)
{
    int x = graph_maps(g, GRAPH_INPUT(g, "features", 1, n, n, p->in));

    for (int i = 0; i < 3; i++)
        x = graph_conv(g, x, &p->impl->conv[i]);
    x = GRAPH_NODE(g, "Mul", graph_act(g, x, ACT_TANH),
                   graph_real(g, PLANE_INIT_MAX));
    GRAPH_OUTPUT(g, graph_rows(g, x), "delta", 1, n, n, 2);
}
