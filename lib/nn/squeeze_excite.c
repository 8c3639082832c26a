/* Squeeze and excite (Hu et al. 2018) as MobileNetV3 has it, and the mean over
 * pixels. */
#include "lib/nn/squeeze_excite.h"

#include <string.h>

#include "lib/base/parallel.h"
#include "lib/nn/act.h"
#include "lib/nn/conv.h"
#include "lib/nn/kernels.h"
#include "lib/nn/params.h"

void squeeze_excite_init(struct squeeze_excite *s, struct params *ps,
                         const char *name, size_t channels, size_t hidden)
{
    char buf[120];
    size_t down[4] = { hidden, channels, 1, 1 };
    size_t up[4] = { channels, hidden, 1, 1 };

    *s = (struct squeeze_excite){ .ps = ps, .channels = channels,
                                  .hidden = hidden };
    s->reduce_w = params_add(ps, nn_name(buf, "%s.conv_reduce.weight", name),
                             4, down, PARAM_HE, 1.0f);
    s->reduce_b = params_add(ps, nn_name(buf, "%s.conv_reduce.bias", name), 1,
                             down, PARAM_ZERO, 0.0f);
    s->expand_w = params_add(ps, nn_name(buf, "%s.conv_expand.weight", name),
                             4, up, PARAM_HE, 1.0f);
    s->expand_b = params_add(ps, nn_name(buf, "%s.conv_expand.bias", name), 1,
                             up, PARAM_ZERO, 0.0f);
}

void squeeze_excite_plan(struct squeeze_excite *s, struct nn_plan *p,
                         size_t batch, size_t pixels)
{
    s->batch = batch;
    s->pixels = pixels;
    s->mean = nn_plan_floats(p, batch * s->channels);
    s->inner = nn_plan_floats(p, batch * s->hidden);
    s->gate = nn_plan_floats(p, batch * s->channels);
    s->part = nn_plan_floats(p, batch * NN_PARTS * s->channels);
    if (!nn_plan_backward(p))
        return;
    s->dgate = nn_plan_floats(p, batch * s->channels);
    s->dinner = nn_plan_floats(p, batch * s->hidden);
    s->dmean = nn_plan_floats(p, batch * s->channels);
}

/* Pieces an image is summed in: by its size alone. */
static size_t squeeze_excite_pieces(size_t pixels)
{
    return pixels >= 128 ? NN_PARTS : 1;
}

/* sum (C) = scale times the sum of n parts (n,C), in order. */
static void squeeze_excite_fold(float *sum, const float *part, size_t n,
                                size_t C, float scale)
{
    for (size_t c = 0; c < C; c++) {
        float s = part[c];

        for (size_t i = 1; i < n; i++)
            s += part[i * C + c];
        sum[c] = s * scale;
    }
}

PARALLEL(spatial_mean_forward_part, i, const struct nn_kernels *, k,
         float *, part, const float *, x, size_t, P, size_t, pixels, size_t, C)
{
    size_t n = i / P, r0 = i % P * pixels / P;
    size_t r1 = (i % P + 1) * pixels / P;

    /* no activation: the map is read only */
    k->act_sums(part + i * C, (float *)x + (n * pixels + r0) * C, x, ACT_NONE,
                r1 - r0, C);
}

void spatial_mean_forward(float *mean, float *part, const float *x, size_t B,
                          size_t pixels, size_t C)
{
    const struct nn_kernels *k = nn_kernels();
    size_t P = squeeze_excite_pieces(pixels);

    parallel_each(spatial_mean_forward_part, B * P, 1, k, part, x, P, pixels,
                  C);
    for (size_t n = 0; n < B; n++)
        squeeze_excite_fold(mean + n * C, part + n * P * C, P, C,
                            1.0f / (float)pixels);
}

PARALLEL(spatial_mean_backward_part, k, float *, dx, const float *, dmean,
         size_t, C, size_t, pixels, float, scale)
{
    size_t n = k / pixels, i = k % pixels;

    for (size_t c = 0; c < C; c++)
        dx[(n * pixels + i) * C + c] = dmean[n * C + c] * scale;
}

void spatial_mean_backward(float *dx, const float *dmean, size_t B,
                           size_t pixels, size_t C)
{
    float scale = 1.0f / (float)pixels;

    parallel_each(spatial_mean_backward_part, B * pixels, 1, dx, dmean, C,
                  pixels, scale);
}

/* The gate of item n from its mean: two small layers. */
PARALLEL(squeeze_excite_gate, n, struct squeeze_excite *, s)
{
    const struct nn_kernels *k = nn_kernels();
    size_t C = s->channels, H = s->hidden;
    float *inner = s->inner + n * H, *gate = s->gate + n * C;

    k->gemv(inner, param_w(s->ps, s->reduce_w), s->mean + n * C,
            param_w(s->ps, s->reduce_b), H, C);
    k->act_forward(inner, inner, ACT_RELU, H);
    k->gemv(gate, param_w(s->ps, s->expand_w), inner,
            param_w(s->ps, s->expand_b), C, H);
    k->act_forward(gate, gate, ACT_HARDSIGMOID, C);
}

PARALLEL(squeeze_excite_scale_part, i, struct squeeze_excite *, s,
         const struct nn_kernels *, k, float *, y, const float *, x, size_t, P,
         size_t, C)
{
    size_t n = i / P, r0 = i % P * s->pixels / P;
    size_t r1 = (i % P + 1) * s->pixels / P;
    size_t at = (n * s->pixels + r0) * C;

    k->channel_scale(y + at, x + at, s->gate + n * C, NULL, r1 - r0, C);
}

void squeeze_excite_forward(float *y, const float *x, struct squeeze_excite *s)
{
    const struct nn_kernels *k = nn_kernels();
    size_t C = s->channels, P = squeeze_excite_pieces(s->pixels), B = s->batch;

    spatial_mean_forward(s->mean, s->part, x, B, s->pixels, C);

    parallel_each(squeeze_excite_gate, B, 1, s);

    parallel_each(squeeze_excite_scale_part, B * P, 1, s, k, y, x, P, C);
}

/* The gate's gradient through its two small layers: dgate -> dmean. */
static void squeeze_excite_gate_backward(struct squeeze_excite *s)
{
    const struct nn_kernels *k = nn_kernels();
    struct params *ps = s->ps;
    size_t C = s->channels, H = s->hidden, B = s->batch;
    const float *we = param_w(ps, s->expand_w), *wr = param_w(ps, s->reduce_w);
    float *dwe = param_g(ps, s->expand_w), *dwr = param_g(ps, s->reduce_w);
    float *dbe = param_g(ps, s->expand_b), *dbr = param_g(ps, s->reduce_b);
    float unit = 1.0f / (float)s->pixels;

    memset(s->dinner, 0, B * H * sizeof *s->dinner);
    memset(s->dmean, 0, B * C * sizeof *s->dmean);
    for (size_t n = 0; n < B; n++)
        for (size_t c = 0; c < C; c++) {
            /* gate = hsig(u): slope 1/6 where it is not saturated */
            float g = s->gate[n * C + c];
            float du = g > 0.0f && g < 1.0f ? s->dgate[n * C + c] / 6 : 0.0f;
            dbe[c] += du;
            k->outer_backward(dwe + c * H, s->dinner + n * H, we + c * H,
                              s->inner + n * H, du, H);
        }
    for (size_t n = 0; n < B; n++) {
        for (size_t h = 0; h < H; h++) {
            float du = s->inner[n * H + h] > 0.0f ? s->dinner[n * H + h]
                                                  : 0.0f;

            dbr[h] += du;
            k->outer_backward(dwr + h * C, s->dmean + n * C, wr + h * C,
                              s->mean + n * C, du, C);
        }
        for (size_t c = 0; c < C; c++)
            s->dmean[n * C + c] *= unit;
    }
}

PARALLEL(squeeze_excite_backward_part, i, struct squeeze_excite *, s,
         const struct nn_kernels *, k, const float *, dy, const float *, x,
         size_t, P, size_t, C)
{
    size_t n = i / P, r0 = i % P * s->pixels / P;
    size_t r1 = (i % P + 1) * s->pixels / P;
    size_t at = (n * s->pixels + r0) * C;

    k->channel_dot(s->part + i * C, dy + at, x + at, r1 - r0, C);
}

PARALLEL(squeeze_excite_gather_part, i, struct squeeze_excite *, s,
         const struct nn_kernels *, k, float *, dx, const float *, dy,
         size_t, P, size_t, C)
{
    size_t n = i / P, r0 = i % P * s->pixels / P;
    size_t r1 = (i % P + 1) * s->pixels / P;
    size_t at = (n * s->pixels + r0) * C;

    k->channel_scale(dx + at, dy + at, s->gate + n * C, s->dmean + n * C,
                     r1 - r0, C);
}

/* In the forward pass this was: y = x gate(mean(x)). */
void squeeze_excite_backward(float *dx, const float *dy, const float *x,
                             struct squeeze_excite *s)
{
    const struct nn_kernels *k = nn_kernels();
    size_t C = s->channels, B = s->batch, P = squeeze_excite_pieces(s->pixels);

    parallel_each(squeeze_excite_backward_part, B * P, 1, s, k, dy, x, P, C);
    for (size_t n = 0; n < B; n++)
        squeeze_excite_fold(s->dgate + n * C, s->part + n * P * C, P, C, 1.0f);
    squeeze_excite_gate_backward(s);

    parallel_each(squeeze_excite_gather_part, B * P, 1, s, k, dx, dy, P, C);
}
