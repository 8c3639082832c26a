/* The logistic unit, forward and backward, and its start at certain. */
#include "lib/net/confidence_head.h"

#include <math.h>

#include "lib/nn/conv.h"

void confidence_head_init(struct confidence_head *s, struct params *ps,
                    const char *prefix, size_t features)
{
    const size_t dims[2] = {1, features};
    char name[120];

    s->ps = ps;
    s->features = features;
    nn_name(name, "%ssure.weight", prefix);
    s->w = params_add(ps, name, 2, dims, PARAM_HE, 0.1f);
    nn_name(name, "%ssure.bias", prefix);
    s->b = params_add(ps, name, 1, dims, PARAM_ZERO, 0.0f);
}

/* Before the sigmoid. */
static double confidence_head_logit(const struct confidence_head *s,
                                    const float *pooled)
{
    const float *w = param_w(s->ps, s->w);
    double z = (double)*param_w(s->ps, s->b);

    for (size_t k = 0; k < s->features; k++)
        z += (double)w[k] * (double)pooled[k];
    return z;
}

float confidence_head_forward(const struct confidence_head *s,
                              const float *pooled)
{
    return s->ps ? (float)(1 / (1 + exp(-confidence_head_logit(s, pooled))))
                 : 1;
}

double confidence_head_loss(const struct confidence_head *s, const float *pooled,
                      double truth, double scale)
{
    double z = confidence_head_logit(s, pooled), p = 1 / (1 + exp(-z));
    float *dw = param_g(s->ps, s->w);

    for (size_t k = 0; k < s->features; k++)
        dw[k] += (float)(scale * (p - truth) * (double)pooled[k]);
    *param_g(s->ps, s->b) += (float)(scale * (p - truth));
    return scale * (fmax(z, 0) - z * truth + log1p(exp(-fabs(z))));
}
