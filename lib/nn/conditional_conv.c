/* A convolution whose weights are a linear function of a few numbers
 * (CondConv, Yang et al. 2019, with given coefficients): the refiner's
 * conditions on how the head has turned. */
#include "lib/nn/conditional_conv.h"

#include <string.h>

/* Weights of the convolution, and of each V_j. */
static size_t conditional_conv_count(const struct conditional_conv *v)
{
    return v->conv->ps->tensor[v->conv->weight].count;
}

void conditional_conv_init(struct conditional_conv *v, struct conv *c,
                           const char *name, size_t n)
{
    char buf[120];
    size_t dims[5] = { n, c->out, c->in, c->kernel, c->kernel };

    *v = (struct conditional_conv){ .conv = c, .n = n };
    v->tensor = params_add(c->ps, nn_name(buf, "%s.vary", name), 5, dims,
                           PARAM_ZERO, 0);
}

void conditional_conv_plan(struct conditional_conv *v, struct nn_plan *p)
{
    v->sum = nn_plan_floats(p, conditional_conv_count(v));
    v->was = nn_plan_backward(p)
                 ? nn_plan_floats(p, conditional_conv_count(v)) : NULL;
}

void conditional_conv_set(struct conditional_conv *v, const float *by)
{
    size_t count = conditional_conv_count(v);
    const float *V = param_w(v->conv->ps, v->tensor);

    memcpy(v->sum, param_w(v->conv->ps, v->conv->weight),
           count * sizeof *v->sum);
    for (size_t j = 0; j < v->n; j++)
        for (size_t i = 0; i < count; i++)
            v->sum[i] += by[j] * V[j * count + i];
    v->conv->from = v->sum;
}

/* The convolution adds its weights' gradient to what is there: it starts from
 * zero here, so that V's can be told from earlier ones. */
void conditional_conv_backward(float *din, float *dby, float *dout,
                               const float *out, const float *in,
                               const float *by, struct conditional_conv *v)
{
    size_t count = conditional_conv_count(v);
    const float *V = param_w(v->conv->ps, v->tensor);
    float *g = param_g(v->conv->ps, v->conv->weight);
    float *gv = param_g(v->conv->ps, v->tensor);

    memcpy(v->was, g, count * sizeof *g);
    memset(g, 0, count * sizeof *g);
    conv_backward(din, dout, out, in, v->conv);
    for (size_t j = 0; j < v->n; j++) {
        double dot = 0;

        for (size_t i = 0; i < count; i++) {
            gv[j * count + i] += by[j] * g[i];
            dot += (double)g[i] * (double)V[j * count + i];
        }
        dby[j] += (float)dot;
    }
    for (size_t i = 0; i < count; i++)
        g[i] += v->was[i];
}
