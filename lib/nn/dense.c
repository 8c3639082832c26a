/* One row through a linear layer, and back. */
#include "lib/nn/dense.h"

#include "lib/nn/conv.h"
#include "lib/nn/kernels.h"

void dense_init(struct dense *d, struct params *ps, const char *name,
                size_t in, size_t out, float gain)
{
    const size_t dims[2] = { out, in };
    char buf[120];

    *d = (struct dense){ .ps = ps, .in = in, .out = out };
    nn_name(buf, "%s.weight", name);
    d->weight = params_add(ps, buf, 2, dims, PARAM_HE, gain);
    nn_name(buf, "%s.bias", name);
    d->bias = params_add(ps, buf, 1, dims, PARAM_ZERO, 0);
}

void dense_forward(float *y, const float *x, const struct dense *d)
{
    nn_kernels()->gemv(y, param_w(d->ps, d->weight), x,
                       param_w(d->ps, d->bias), d->out, d->in);
}

void dense_backward(float *dx, const float *dy, const float *x,
                    const struct dense *d)
{
    const float *w = param_w(d->ps, d->weight);
    float *dw = param_g(d->ps, d->weight), *db = param_g(d->ps, d->bias);

    for (size_t o = 0; o < d->out; o++) {
        db[o] += dy[o];
        nn_kernels()->outer_backward(dw + o * d->in, dx, w + o * d->in, x,
                                     dy[o], d->in);
    }
}
