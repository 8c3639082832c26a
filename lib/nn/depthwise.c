/* Depthwise convolutions: planning, weights with the norm folded in, and the
 * split of the work into 16 channels by a band of rows. */
#include "lib/nn/depthwise.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "lib/base/parallel.h"
#include "lib/nn/kernels.h"

void depthwise_init(struct depthwise *d, struct params *ps, const char *name,
                    size_t channels, size_t kernel, size_t stride)
{
    char buf[120];
    size_t dims[4] = { channels, 1, kernel, kernel };

    assert((kernel == 3 || kernel == 5) && (stride == 1 || stride == 2));
    *d = (struct depthwise){ .ps = ps, .channels = channels,
                             .kernel = kernel, .stride = stride };
    d->weight = params_add(ps, nn_name(buf, "%s.weight", name), 4, dims,
                           PARAM_HE, 1);
}

/* Output pixels along an axis of `size`, and the padding before the first. */
static size_t depthwise_out_size(size_t *before, size_t size,
                                 const struct depthwise *d)
{
    size_t out = (size + d->stride - 1) / d->stride;
    size_t need = (out - 1) * d->stride + d->kernel;
    size_t total = need > size ? need - size : 0;

    *before = d->pad == CONV_SAME ? total / 2 : d->kernel / 2;
    return out;
}

/* Taps and bias from the weights, with the norm folded in. */
static void depthwise_update(void *layer)
{
    struct depthwise *d = layer;
    const struct batch_norm *bn = d->norm;
    const struct params *ps = d->ps;
    const float *w = param_w(ps, d->weight);
    size_t taps = d->kernel * d->kernel, L = DEPTHWISE_LANES;

    for (size_t c = 0; c < d->channels; c++) {
        size_t at = c / L * L * taps + c % L;
        float scale = 1, bias = 0;

        if (bn) {
            scale = param_w(ps, bn->weight)[c] /
                    sqrtf(param_w(ps, bn->var)[c] + bn->eps);
            bias = param_w(ps, bn->bias)[c] -
                   param_w(ps, bn->mean)[c] * scale;
        }
        d->bias[c] = bias;
        for (size_t i = 0; i < taps; i++) {
            d->taps[at + i * L] = w[c * taps + i] * scale;
            if (d->flipped)
                d->flipped[at + (taps - 1 - i) * L] = w[c * taps + i] * scale;
        }
    }
}

void depthwise_plan(struct depthwise *d, struct nn_plan *p, size_t batch,
                    size_t h, size_t w)
{
    size_t C = d->channels, K = d->kernel, S = d->stride;
    size_t T = DEPTHWISE_COLUMNS, R = DEPTHWISE_ROWS, L = DEPTHWISE_LANES;
    size_t whole = (C + L - 1) / L * L;

    nn_plan_layer(p, (struct nn_layer){d, depthwise_update, NULL});
    d->plan = p;
    d->batch = batch;
    d->h = h;
    d->w = w;
    d->oh = depthwise_out_size(&d->top, h, d);
    d->ow = depthwise_out_size(&d->left, w, d);
    d->taps = nn_plan_floats(p, K * K * whole);
    d->bias = nn_plan_floats(p, whole);
    size_t wide = (d->ow + T) * S + w + T + 2 * K;
    size_t piece = ((R - 1) * S + K) * wide + (R + K) * (w + T + 2 * K);
    d->pad_size = (piece + R * wide) * DEPTHWISE_LANES;
    nn_plan_scratch(p, d->pad_size * sizeof(float) *
                           (size_t)parallel_width());
    if (!nn_plan_backward(p))
        return;
    d->flipped = nn_plan_floats(p, K * K * whole);
    d->dw = nn_plan_floats(p, batch * K * K * C);
}

/* The calling thread's padded buffer in the plan's scratch. */
static float *depthwise_thread_pad(const struct depthwise *d)
{
    return (float *)(void *)d->plan->scratch +
           parallel_slot() * d->pad_size;
}

PARALLEL(depthwise_forward_part, at, float *, out, const float *, in,
         struct depthwise *, d, size_t, L, size_t, R, size_t, bands,
         size_t, blocks)
{
    size_t n = at / (bands * blocks), b = at / blocks % bands, c = at % blocks;

    nn_kernels()->depthwise_forward(out, in, depthwise_thread_pad(d), d, n,
                                    c * L, b * R,
                                    b + 1 < bands ? (b + 1) * R : d->oh);
}

void depthwise_forward(float *out, const float *in, struct depthwise *d)
{
    size_t R = DEPTHWISE_ROWS, L = DEPTHWISE_LANES;
    size_t blocks = (d->channels + L - 1) / L, bands = (d->oh + R - 1) / R;

    parallel_each(depthwise_forward_part, d->batch * bands * blocks, 1, out, in,
                  d, L, R, bands, blocks);
}

PARALLEL(depthwise_backward_part, at, struct depthwise *, d,
         const float *, dout, const float *, in, size_t, taps, size_t, C,
         size_t, L, size_t, blocks)
{
    size_t n = at / blocks, c = at % blocks;

    nn_kernels()->depthwise_backward_weights(d->dw + n * taps * C, dout, in,
                                             depthwise_thread_pad(d), d, n,
                                             c * L);
}

PARALLEL(depthwise_data_part, at, float *, din, const float *, dout,
         struct depthwise *, d, size_t, L, size_t, R, size_t, bands,
         size_t, blocks)
{
    size_t n = at / (bands * blocks), b = at / blocks % bands, c = at % blocks;

    nn_kernels()->depthwise_backward_data(din, dout, depthwise_thread_pad(d), d,
                                          n, c * L, b * R,
                                          b + 1 < bands ? (b + 1) * R : d->h);
}

/* In the forward pass this was, per channel, with S the stride:
 *   out[y][x] = sum_{ky,kx} taps[ky][kx] in[y S + ky - top][x S + kx - left] */
void depthwise_backward(float *din, const float *dout, const float *in,
                        struct depthwise *d)
{
    size_t R = DEPTHWISE_ROWS, L = DEPTHWISE_LANES, C = d->channels;
    size_t blocks = (C + L - 1) / L, bands = (d->h + R - 1) / R;
    size_t taps = d->kernel * d->kernel;

    parallel_each(depthwise_backward_part, d->batch * blocks, 1, d, dout, in,
                  taps, C, L, blocks);
    float *g = param_g(d->ps, d->weight);
    for (size_t n = 0; n < d->batch; n++)
        for (size_t i = 0; i < taps; i++)
            for (size_t c = 0; c < C; c++)
                g[c * taps + i] += d->dw[(n * taps + i) * C + c];
    if (!din)
        return;

    parallel_each(depthwise_data_part, d->batch * bands * blocks, 1, din, dout,
                  d, L, R, bands, blocks);
}
