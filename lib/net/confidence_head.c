/* The logistic unit, forward and backward, and its start at certain. */
#include "lib/net/confidence_head.h"

#include <math.h>

#include "lib/nn/conv.h"

void confidence_head_init(struct dense *d, struct params *ps,
                          const char *prefix, size_t features)
{
    char name[120];

    nn_name(name, "%ssure", prefix);
    dense_init(d, ps, name, features, 1, 0.1f);
}

/* Before the sigmoid. */
static double confidence_head_logit(const struct dense *d,
                                    const float *pooled)
{
    const float *w = param_w(d->ps, d->weight);
    double z = (double)*param_w(d->ps, d->bias);

    for (size_t k = 0; k < d->in; k++)
        z += (double)w[k] * (double)pooled[k];
    return z;
}

float confidence_head_forward(const struct dense *d,
                              const float *pooled)
{
    return d->ps ? (float)(1 / (1 + exp(-confidence_head_logit(d, pooled))))
                 : 1;
}

double confidence_head_loss(const struct dense *d, const float *pooled,
                            double truth, double scale)
{
    double z = confidence_head_logit(d, pooled), p = 1 / (1 + exp(-z));
    float *dw = param_g(d->ps, d->weight);

    for (size_t k = 0; k < d->in; k++)
        dw[k] += (float)(scale * (p - truth) * (double)pooled[k]);
    *param_g(d->ps, d->bias) += (float)(scale * (p - truth));
    return scale * (fmax(z, 0) - z * truth + log1p(exp(-fabs(z))));
}
