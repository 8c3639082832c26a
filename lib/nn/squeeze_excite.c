/* Squeeze and excite (Hu et al. 2018) as MobileNetV3 has it, and the mean over
 * pixels. */
#include "lib/nn/squeeze_excite.h"

#include "lib/base/parallel.h"
#include "lib/nn/act.h"
#include "lib/nn/kernels.h"

void squeeze_excite_init(struct squeeze_excite *s, struct params *ps,
                         const char *name, size_t channels, size_t hidden)
{
    char buf[120];

    *s = (struct squeeze_excite){ 0 };
    nn_name(buf, "%s.conv_reduce", name);
    conv_init(&s->reduce, ps, buf, channels, hidden, 1, 1, true);
    nn_name(buf, "%s.conv_expand", name);
    conv_init(&s->expand, ps, buf, hidden, channels, 1, 1, true);
    s->reduce.act = ACT_RELU;
}

void squeeze_excite_plan(struct squeeze_excite *s, struct nn_plan *p,
                         size_t batch, size_t pixels)
{
    const size_t C = s->reduce.in, hidden = s->reduce.out;

    s->batch = batch;
    s->pixels = pixels;
    s->mean = nn_plan_floats(p, batch * C);
    s->inner = nn_plan_floats(p, batch * hidden);
    s->gate = nn_plan_floats(p, batch * C);
    s->part = nn_plan_floats(p, batch * NN_PARTS * C);
    linear_plan(&s->reduce, p, batch);
    linear_plan(&s->expand, p, batch);
    if (!nn_plan_backward(p))
        return;
    s->dgate = nn_plan_floats(p, batch * C);
    s->dinner = nn_plan_floats(p, batch * hidden);
    s->dmean = nn_plan_floats(p, batch * C);
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

PARALLEL(spatial_mean_forward_part, i, float *, part, const float *, x,
         size_t, P, size_t, pixels, size_t, C)
{
    size_t n = i / P, r0 = i % P * pixels / P;
    size_t r1 = (i % P + 1) * pixels / P;

    /* no activation: the map is read only */
    nn_kernels()->act_sums(part + i * C, (float *)x + (n * pixels + r0) * C, x,
                           ACT_NONE, r1 - r0, C);
}

void spatial_mean_forward(float *mean, float *part, const float *x, size_t B,
                          size_t pixels, size_t C)
{
    size_t P = squeeze_excite_pieces(pixels);

    parallel_each(spatial_mean_forward_part, B * P, 1, part, x, P, pixels, C);
    for (size_t n = 0; n < B; n++)
        squeeze_excite_fold(mean + n * C, part + n * P * C, P, C,
                            1 / (float)pixels);
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
    float scale = 1 / (float)pixels;

    parallel_each(spatial_mean_backward_part, B * pixels, 1, dx, dmean, C,
                  pixels, scale);
}

PARALLEL(squeeze_excite_scale_part, i, struct squeeze_excite *, s, float *, y,
         const float *, x, size_t, P, size_t, C)
{
    size_t n = i / P, r0 = i % P * s->pixels / P;
    size_t r1 = (i % P + 1) * s->pixels / P;
    size_t at = (n * s->pixels + r0) * C;

    nn_kernels()->channel_scale(y + at, x + at, s->gate + n * C, NULL, r1 - r0,
                                C);
}

void squeeze_excite_forward(float *y, const float *x, struct squeeze_excite *s)
{
    size_t C = s->reduce.in, P = squeeze_excite_pieces(s->pixels), B = s->batch;

    spatial_mean_forward(s->mean, s->part, x, B, s->pixels, C);

    conv_forward(s->inner, s->mean, &s->reduce);
    conv_forward(s->gate, s->inner, &s->expand);
    if (!s->additive)
        act_forward(s->gate, s->gate, ACT_HARDSIGMOID, B * C);
    for (size_t i = 0; s->additive && i < B * C; i++)
        s->gate[i] += 1;
    parallel_each(squeeze_excite_scale_part, B * P, 1, s, y, x, P, C);
}

/* The gate's gradient through its two small layers: dgate -> dmean. */
static void squeeze_excite_gate_backward(struct squeeze_excite *s)
{
    const size_t n = s->batch * s->reduce.in;

    /* gate = hsig(u): slope 1/6 where it is not saturated */
    for (size_t i = 0; !s->additive && i < n; i++)
        s->dgate[i] *= s->gate[i] > 0 && s->gate[i] < 1 ? 1.0f / 6 : 0;
    conv_backward(s->dinner, s->dgate, s->gate, s->inner, &s->expand);
    conv_backward(s->dmean, s->dinner, s->inner, s->mean, &s->reduce);
    for (size_t i = 0; i < n; i++)
        s->dmean[i] /= (float)s->pixels;
}

PARALLEL(squeeze_excite_backward_part, i, struct squeeze_excite *, s,
         const float *, dy, const float *, x, size_t, P, size_t, C)
{
    size_t n = i / P, r0 = i % P * s->pixels / P;
    size_t r1 = (i % P + 1) * s->pixels / P;
    size_t at = (n * s->pixels + r0) * C;

    nn_kernels()->channel_dot(s->part + i * C, dy + at, x + at, r1 - r0, C);
}

PARALLEL(squeeze_excite_gather_part, i, struct squeeze_excite *, s, float *, dx,
         const float *, dy, size_t, P, size_t, C)
{
    size_t n = i / P, r0 = i % P * s->pixels / P;
    size_t r1 = (i % P + 1) * s->pixels / P;
    size_t at = (n * s->pixels + r0) * C;

    nn_kernels()->channel_scale(dx + at, dy + at, s->gate + n * C,
                                s->dmean + n * C, r1 - r0, C);
}

/* In the forward pass this was: y = x gate(mean(x)). */
void squeeze_excite_backward(float *dx, const float *dy, const float *x,
                             struct squeeze_excite *s)
{
    size_t C = s->reduce.in, B = s->batch, P = squeeze_excite_pieces(s->pixels);

    parallel_each(squeeze_excite_backward_part, B * P, 1, s, dy, x, P, C);
    for (size_t n = 0; n < B; n++)
        squeeze_excite_fold(s->dgate + n * C, s->part + n * P * C, P, C, 1);
    squeeze_excite_gate_backward(s);

    parallel_each(squeeze_excite_gather_part, B * P, 1, s, dx, dy, P, C);
}
