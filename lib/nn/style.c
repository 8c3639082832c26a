/* The style's scaling of the input and the end of a modulated convolution, and
 * the layers that they are parts of. */
#include "lib/nn/style.h"

#include <math.h>
#include <string.h>

#include "lib/base/parallel.h"
#include "lib/nn/kernels.h"

#define EPS 1e-8

/* Parts that sums over rows are made in: by their number alone. */
static size_t style_part_count(size_t rows)
{
    return rows < 8 * NN_SUMS ? 1 : NN_SUMS;
}

/* ---- x st, a vector per image ---------------------------------------------- */

struct style_scale {
    float *part;                /* (NN_SUMS,C) */
};

static void style_scale_plan(struct tape_step *s, struct nn_plan *p)
{
    struct style_scale *l = s->layer;

    if (nn_plan_backward(p))
        l->part = nn_plan_floats(p, NN_SUMS * s->channels);
}

PARALLEL(style_scale_part, part, float *, y, const float *, x,
         const float *, st, size_t, pixels, size_t, P, size_t, C)
{
    size_t n = part / P, i = part % P;
    size_t r0 = i * pixels / P, r1 = (i + 1) * pixels / P;
    size_t at = (n * pixels + r0) * C;

    nn_kernels()->channel_scale(y + at, x + at, st + n * C, NULL, r1 - r0, C);
}

/* y = x times the style. */
static void style_scale_images(float *y, const float *x,
                               const struct tape_step *s)
{
    size_t pixels = s->h * s->w, P = style_part_count(pixels);

    parallel_each(style_scale_part, s->batch * P, 1, y, x, s->of[1]->x, pixels,
                  P, s->channels);
}

static void style_scale_forward(struct tape_step *s)
{
    style_scale_images(s->out, s->of[0]->x, s);
}

PARALLEL(style_dot_part, i, float *, part, const float *, a, const float *, b,
         size_t, rows, size_t, P, size_t, C)
{
    size_t r0 = i * rows / P, r1 = (i + 1) * rows / P;

    nn_kernels()->channel_dot(part + i * C, a + r0 * C, b + r0 * C, r1 - r0, C);
}

/* dst (B,C): sums of s->d x over each image's pixels. */
static void style_scale_dot(float *dst, const struct tape_step *s)
{
    const struct style_scale *l = s->layer;
    const size_t pixels = s->h * s->w, P = style_part_count(pixels);
    const size_t C = s->channels, n = pixels * C;

    memset(dst, 0, s->batch * C * sizeof *dst);
    for (size_t b = 0; b < s->batch; b++, dst += C) {
        parallel_each(style_dot_part, P, 1, l->part, s->d + b * n,
                      s->of[0]->x + b * n, pixels, P, C);
        for (size_t i = 0; i < P * C; i++)
            dst[i % C] += l->part[i];
    }
}

static void style_scale_backward(float *to, struct tape_step *s, int k)
{
    if (k)
        style_scale_dot(to, s);
    else
        style_scale_images(to, s->d, s);
}

static const struct tape_op scale_op = {
    sizeof(struct style_scale), 1, false, style_scale_plan,
    style_scale_forward, style_scale_backward, NULL
};

/* ---- lrelu(u d + gain noise + bias) ----------------------------------------- */

/* d = sqrt 2 / sqrt(sum_i st_i^2 squares[o][i] + eps), of each image.  It reads
 * u and st. */
struct style_finish {
    struct params *ps;
    size_t weight, gain, bias, noise;   /* tensors: the convolution's; (1),
                                         * (1,C,1,1), (1,1,h,w) */
    size_t in;
    float *squares;             /* (out,in): sums of w^2 over the kernel */
    float *d, *dd;              /* (B,out), (out) */
    float *part;                /* (NN_SUMS,3,out) */
};

static void style_finish_update(void *layer)
{
    struct tape_step *s = layer;
    struct style_finish *l = s->layer;
    const float *w = param_w(l->ps, l->weight);

    for (size_t i = 0; i < s->channels * l->in; i++) {
        double sum = 0;

        for (size_t k = 0; k < 9; k++)
            sum += (double)w[i * 9 + k] * (double)w[i * 9 + k];
        l->squares[i] = (float)sum;
    }
}

static void style_finish_plan(struct tape_step *s, struct nn_plan *p)
{
    struct style_finish *l = s->layer;

    nn_plan_layer(p, (struct nn_layer){s, style_finish_update, NULL});
    l->squares = nn_plan_floats(p, s->channels * l->in);
    l->d = nn_plan_floats(p, s->batch * s->channels);
    if (!nn_plan_backward(p))
        return;
    l->part = nn_plan_floats(p, NN_SUMS * 3 * s->channels);
    l->dd = nn_plan_floats(p, s->channels);
}

static void style_demodulate(const struct tape_step *s)
{
    const struct style_finish *l = s->layer;

    for (size_t n = 0; n < s->batch; n++)
        for (size_t o = 0; o < s->channels; o++) {
            const float *st = s->of[1]->x + n * l->in;
            const float *q = l->squares + o * l->in;
            double sum = EPS;

            for (size_t i = 0; i < l->in; i++)
                sum += (double)(st[i] * st[i]) * (double)q[i];
            l->d[n * s->channels + o] = (float)(M_SQRT2 / sqrt(sum));
        }
}

PARALLEL(style_finish_part, part, struct tape_step *, s, size_t, pixels,
         size_t, P)
{
    const struct style_finish *l = s->layer;
    size_t n = part / P, i = part % P, C = s->channels;
    size_t r0 = i * pixels / P, r1 = (i + 1) * pixels / P;
    size_t at = (n * pixels + r0) * C;

    nn_kernels()->style_finish(s->out + at, s->of[0]->x + at, l->d + n * C,
                               param_w(l->ps, l->bias),
                               param_w(l->ps, l->noise) + r0,
                               *param_w(l->ps, l->gain), r1 - r0, C);
}

static void style_finish_forward(struct tape_step *s)
{
    size_t pixels = s->h * s->w, P = style_part_count(pixels);

    style_demodulate(s);
    parallel_each(style_finish_part, s->batch * P, 1, s, pixels, P);
}

PARALLEL(style_finish_backward_part, i, struct tape_step *, s, size_t, n,
         size_t, pixels, size_t, P)
{
    const struct style_finish *l = s->layer;
    size_t r0 = i * pixels / P, r1 = (i + 1) * pixels / P, C = s->channels;
    size_t at = (n * pixels + r0) * C;

    nn_kernels()->style_backward(s->d + at, l->part + i * 3 * C, s->d + at,
                                 s->x + at, s->of[0]->x + at, l->d + n * C,
                                 param_w(l->ps, l->noise) + r0, r1 - r0, C);
}

/* Image n: s->d becomes u's gradient; bias, noise gain; l->dd, the gradient of
 * d. */
static void style_finish_sums(struct tape_step *s, size_t n)
{
    const struct style_finish *l = s->layer;
    const size_t pixels = s->h * s->w, P = style_part_count(pixels);
    const size_t C = s->channels;
    float *db = param_g(l->ps, l->bias), *dgain = param_g(l->ps, l->gain);

    parallel_each(style_finish_backward_part, P, 1, s, n, pixels, P);
    for (size_t c = 0; c < C; c++) {
        double sum[3] = { 0 };

        for (size_t i = 0; i < P; i++)
            for (size_t j = 0; j < 3; j++)
                sum[j] += (double)l->part[(i * 3 + j) * C + c];
        db[c] += (float)sum[0];
        l->dd[c] = (float)sum[1];
        *dgain += (float)sum[2];
    }
}

/* In the forward pass: d = sqrt 2 (q + eps)^-1/2, q = sum_i st_i^2 squares. */
static void style_demodulate_backward(float *dst, const float *st,
                                      const float *d,
                                      const struct tape_step *s)
{
    const struct style_finish *l = s->layer;
    const float *w = param_w(l->ps, l->weight);
    float *dw = param_g(l->ps, l->weight);

    for (size_t o = 0; o < s->channels; o++) {
        const double each = (double)d[o];
        float dq = (float)(-0.25 * each * each * each * (double)l->dd[o]);

        for (size_t i = 0; i < l->in; i++) {
            float a = 2 * dq * st[i];

            dst[i] += a * l->squares[o * l->in + i];
            for (size_t k = 0; k < 9; k++)
                dw[(o * l->in + i) * 9 + k] +=
                    a * st[i] * w[(o * l->in + i) * 9 + k];
        }
    }
}

static void style_finish_backward(float *to, struct tape_step *s, int k)
{
    const struct style_finish *l = s->layer;

    if (k == 0) {
        memcpy(to, s->d, tape_count(s) * sizeof *to);
        return;
    }
    memset(to, 0, s->batch * l->in * sizeof *to);
    for (size_t n = 0; n < s->batch; n++) {
        style_finish_sums(s, n);
        style_demodulate_backward(to + n * l->in, s->of[1]->x + n * l->in,
                                  l->d + n * s->channels, s);
    }
}

static const struct tape_op finish_op = {
    sizeof(struct style_finish), 1, true, style_finish_plan,
    style_finish_forward, style_finish_backward, NULL
};

/* ---- the layers -------------------------------------------------------------- */

/* st (B,C) of the latent code. */
static int style_of_latent(struct tape *t, int latent, const char *name,
                           size_t C)
{
    char buf[120];
    const int st = tape_linear(
        t, latent, nn_name(buf, "%s.modulated_conv.modulation", name), C);
    const struct conv *l = tape_layer(t, st);

    t->ps->tensor[l->bias].init = PARAM_ONE;
    t->ps->tensor[l->weight].gain = 0.1f;
    return st;
}

/* The convolution, whose weight has StyleGAN's shape: (1,out,in,k,k). */
static int style_convolve(struct tape *t, int x, int onto, const char *name,
                          size_t out, size_t kernel)
{
    const size_t dims[5] = {1, out, tape_channels(t, x), kernel, kernel};
    char buf[120];

    nn_name(buf, "%s.modulated_conv", name);
    x = onto < 0 ? tape_conv(t, x, buf, out, kernel, false)
                 : tape_conv_onto(t, onto, x, buf, out, kernel, false);
    const struct conv *c = tape_layer(t, x);
    struct param *w = &t->ps->tensor[c->weight];
    w->ndim = 5;
    memcpy(w->dim, dims, sizeof dims);
    return x;
}

/* The end's tensors. */
static int style_end(struct tape *t, int u, int st, const char *name,
                     const char *noise, size_t side, size_t in)
{
    const struct conv *c = tape_layer(t, u);
    const size_t one = 1, C = tape_channels(t, u);
    const size_t bias[4] = {1, C, 1, 1}, map[4] = {1, 1, side, side};
    const int y = TAPE_STEP(t, &finish_op, u, st);
    struct style_finish *l = t->map[y]->layer;
    char buf[120];

    *l = (struct style_finish){.ps = t->ps, .weight = c->weight, .in = in};
    l->gain = params_add(t->ps, nn_name(buf, "%s.weight", name), 1, &one,
                         PARAM_ZERO, 0);
    l->bias = params_add(t->ps, nn_name(buf, "%s.bias", name), 4, bias,
                         PARAM_ZERO, 0);
    l->noise = params_add(t->ps, noise, 4, map, PARAM_NORMAL, 1);
    t->ps->tensor[l->noise].frozen = true;
    return y;
}

int style_conv(struct tape *t, int x, int latent, const char *name,
               const char *noise, size_t side, size_t out, bool up)
{
    const size_t in = tape_channels(t, x);
    const int st = style_of_latent(t, latent, name, in);

    x = TAPE_STEP(t, &scale_op, x, st);
    if (up)
        x = tape_rescale(t, x, RESCALE_BILINEAR, side, side);
    return style_end(t, style_convolve(t, x, -1, name, out, 3), st, name, noise,
                     side, in);
}

int style_to_rgb(struct tape *t, int x, int latent, int before,
                 const char *name, size_t side)
{
    const int st = style_of_latent(t, latent, name, tape_channels(t, x));
    const size_t bias[4] = {1, 3, 1, 1};
    char buf[120];

    if (before >= 0)
        before = tape_rescale(t, before, RESCALE_BILINEAR, side, side);
    x = style_convolve(t, TAPE_STEP(t, &scale_op, x, st), before, name, 3, 1);
    struct conv *c = tape_layer(t, x);
    c->bias = params_add(t->ps, nn_name(buf, "%s.bias", name), 4, bias,
                         PARAM_ZERO, 0);
    return x;
}
