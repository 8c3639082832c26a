/* StyleGAN2's modulated convolution (Karras et al. 2020) as a scaling of the
 * input by the style and of the output by the demodulation, and its layer to
 * RGB. */
#include "lib/nn/style.h"

#include <math.h>
#include <string.h>

#include "lib/base/parallel.h"
#include "lib/nn/image.h"
#include "lib/nn/kernels.h"

#define EPS 1e-8

/* Parts that sums over rows are made in: by their number alone. */
static size_t style_part_count(size_t rows)
{
    return rows < 8 * NN_SUMS ? 1 : NN_SUMS;
}

/* A conv's weight as StyleGAN names and shapes it: (1,out,in,k,k). */
static void style_declare(struct conv *c, struct conv *modulation,
                          struct params *ps, const char *name, size_t in,
                          size_t out, size_t kernel, size_t latent)
{
    char buf[120];

    nn_name(buf, "%s.modulated_conv", name);
    conv_init(c, ps, buf, in, out, kernel, 1, false);
    struct param *t = &ps->tensor[c->weight];
    size_t dims[5] = { 1, out, in, kernel, kernel };
    t->ndim = 5;
    memcpy(t->dim, dims, sizeof dims);
    nn_name(buf, "%s.modulated_conv.modulation", name);
    linear_init(modulation, ps, buf, latent, in);
    ps->tensor[modulation->bias].init = PARAM_ONE;
    ps->tensor[modulation->weight].gain = 0.1f;
}

void style_conv_init(struct style_conv *s, struct params *ps,
                     const char *name, const char *noise_name, size_t size,
                     size_t in, size_t out, size_t latent, bool up)
{
    char buf[120];
    size_t one = 1, bias[4] = { 1, out, 1, 1 }, noise[4] = { 1, 1, size, size };

    memset(s, 0, sizeof *s);
    s->ps = ps;
    s->in = in;
    s->out = out;
    s->up = up;
    style_declare(&s->conv, &s->modulation, ps, name, in, out, 3, latent);
    s->gain = params_add(ps, nn_name(buf, "%s.weight", name), 1, &one,
                         PARAM_ZERO, 0);
    s->bias = params_add(ps, nn_name(buf, "%s.bias", name), 4, bias,
                         PARAM_ZERO, 0);
    s->noise = params_add(ps, noise_name, 4, noise, PARAM_NORMAL, 1);
    ps->tensor[s->noise].frozen = true;
}

/* Sums of the weights' squares over the kernel. */
static void style_conv_update(void *layer)
{
    struct style_conv *s = layer;
    const float *w = param_w(s->ps, s->conv.weight);

    for (size_t i = 0; i < s->out * s->in; i++) {
        double sum = 0;

        for (size_t k = 0; k < 9; k++)
            sum += (double)w[i * 9 + k] * (double)w[i * 9 + k];
        s->squares[i] = (float)sum;
    }
}

void style_conv_plan(struct style_conv *s, struct nn_plan *p, size_t batch,
                     size_t h, size_t w)
{
    size_t rows = batch * h * w, low = s->up ? rows / 4 : rows;
    size_t max = s->in > s->out ? s->in : s->out;

    s->plan = p;
    s->batch = batch;
    s->h = h;
    s->w = w;
    nn_plan_layer(p, (struct nn_layer){s, style_conv_update, NULL});
    s->squares = nn_plan_floats(p, s->out * s->in);
    s->st = nn_plan_floats(p, batch * s->in);
    s->d = nn_plan_floats(p, batch * s->out);
    linear_plan(&s->modulation, p, batch);
    s->xs = nn_plan_map(p, low * s->in);
    s->xu = s->up ? nn_plan_map(p, rows * s->in) : s->xs;
    if (s->up)
        rescale_plan(&s->grow, p, RESCALE_BILINEAR, batch, h / 2, w / 2, h, w,
                     s->in);
    conv_plan(&s->conv, p, batch, h, w);
    s->y = nn_plan_map(p, rows * s->out);
    s->u = nn_plan_backward(p) ? nn_plan_map(p, rows * s->out) : s->y;
    nn_plan_recycle(p, s->xs);
    if (s->up)
        nn_plan_recycle(p, s->xu);
    if (!nn_plan_backward(p))
        return;
    s->part = nn_plan_floats(p, NN_SUMS * 3 * max);
    s->dd = nn_plan_floats(p, s->out);
    s->dst = nn_plan_floats(p, batch * s->in);
    s->dlatent = nn_plan_floats(p, batch * s->modulation.in);
}

/* d = sqrt 2 / sqrt(sum_i st_i^2 squares[o][i] + eps) */
static void style_demodulate(struct style_conv *s)
{
    for (size_t n = 0; n < s->batch; n++)
        for (size_t o = 0; o < s->out; o++) {
            const float *st = s->st + n * s->in, *q = s->squares + o * s->in;
            double sum = EPS;

            for (size_t i = 0; i < s->in; i++)
                sum += (double)(st[i] * st[i]) * (double)q[i];
            s->d[n * s->out + o] = (float)(M_SQRT2 / sqrt(sum));
        }
}

PARALLEL(style_scale_images_part, part, float *, y, const float *, x,
         const float *, st, size_t, pixels, size_t, P, size_t, C)
{
    size_t n = part / P, i = part % P;
    size_t r0 = i * pixels / P, r1 = (i + 1) * pixels / P;
    size_t at = (n * pixels + r0) * C;

    nn_kernels()->channel_scale(y + at, x + at, st + n * C, NULL, r1 - r0, C);
}

/* y = x st, a vector per image of `pixels` rows. */
static void style_scale_images(float *y, const float *x, const float *st,
                               size_t B, size_t pixels, size_t C)
{
    size_t P = style_part_count(pixels);

    parallel_each(style_scale_images_part, B * P, 1, y, x, st, pixels, P, C);
}

PARALLEL(style_conv_forward_part, part, struct style_conv *, s,
         const float *, bias, const float *, noise, size_t, pixels, size_t, P,
         size_t, C, float, gain)
{
    size_t n = part / P, i = part % P;
    size_t r0 = i * pixels / P, r1 = (i + 1) * pixels / P;
    size_t at = (n * pixels + r0) * C;

    nn_kernels()->style_finish(s->y + at, s->u + at, s->d + n * C, bias,
                               noise + r0, gain, r1 - r0, C);
}

void style_conv_forward(const float *x, const float *latent,
                        struct style_conv *s)
{
    size_t pixels = s->h * s->w, P = style_part_count(pixels), C = s->out;
    const float *noise = param_w(s->ps, s->noise);
    const float *bias = param_w(s->ps, s->bias);
    float gain = *param_w(s->ps, s->gain);

    conv_forward(s->st, latent, &s->modulation);
    style_demodulate(s);
    style_scale_images(s->xs, x, s->st, s->batch, s->up ? pixels / 4 : pixels,
                       s->in);
    if (s->up)
        rescale_forward(s->xu, s->xs, &s->grow);
    conv_forward(s->u, s->xu, &s->conv);

    parallel_each(style_conv_forward_part, s->batch * P, 1, s, bias, noise,
                  pixels, P, C, gain);
}

PARALLEL(style_finish_backward_part, i, float *, du, struct style_conv *, s,
         const float *, dy, const float *, noise, size_t, pixels, size_t, P,
         size_t, n, size_t, C)
{
    size_t r0 = i * pixels / P, r1 = (i + 1) * pixels / P;
    size_t at = (n * pixels + r0) * C;

    nn_kernels()->style_backward(du + at, s->part + i * 3 * C, dy + at,
                                 s->y + at, s->u + at, s->d + n * C, noise + r0,
                                 r1 - r0, C);
}

/* One image: du from dy; bias, noise gain; dd (out), the gradient of d. */
static void style_finish_backward(float *du, float *dd, const float *dy,
                                  size_t n, struct style_conv *s)
{
    size_t pixels = s->h * s->w, P = style_part_count(pixels), C = s->out;
    const float *noise = param_w(s->ps, s->noise);
    float *db = param_g(s->ps, s->bias), *dgain = param_g(s->ps, s->gain);

    parallel_each(style_finish_backward_part, P, 1, du, s, dy, noise, pixels, P,
                  n, C);
    for (size_t c = 0; c < C; c++) {
        double sum[3] = { 0 };

        for (size_t i = 0; i < P; i++)
            for (size_t j = 0; j < 3; j++)
                sum[j] += (double)s->part[(i * 3 + j) * C + c];
        db[c] += (float)sum[0];
        dd[c] = (float)sum[1];
        *dgain += (float)sum[2];
    }
}

/* In the forward pass: d = sqrt 2 (q + eps)^-1/2, q = sum_i st_i^2 squares. */
static void style_demodulate_backward(const float *dd, size_t n,
                                      struct style_conv *s)
{
    const float *w = param_w(s->ps, s->conv.weight);
    float *dw = param_g(s->ps, s->conv.weight);
    const float *st = s->st + n * s->in;
    float *dst = s->dst + n * s->in;

    for (size_t o = 0; o < s->out; o++) {
        double d = (double)s->d[n * s->out + o];
        float dq = (float)(-0.25 * d * d * d * (double)dd[o]);

        for (size_t i = 0; i < s->in; i++) {
            float a = 2 * dq * st[i];

            dst[i] += a * s->squares[o * s->in + i];
            for (size_t k = 0; k < 9; k++)
                dw[(o * s->in + i) * 9 + k] +=
                    a * st[i] * w[(o * s->in + i) * 9 + k];
        }
    }
}

PARALLEL(style_dot_part, i, float *, part, const float *, a, const float *, b,
         size_t, rows, size_t, P, size_t, C)
{
    size_t r0 = i * rows / P, r1 = (i + 1) * rows / P;

    nn_kernels()->channel_dot(part + i * C, a + r0 * C, b + r0 * C, r1 - r0, C);
}

/* In the forward pass: y = x st, a vector per image of `pixels` rows.  dst (B,C)
 * += its gradient from dy; part: scratch of NN_SUMS C. */
static void style_scale_backward(float *dst, float *part, const float *dy,
                                 const float *x, size_t B, size_t pixels,
                                 size_t C)
{
    const size_t P = style_part_count(pixels);

    for (size_t n = 0; n < B; n++) {
        parallel_each(style_dot_part, P, 1, part, dy + n * pixels * C,
                      x + n * pixels * C, pixels, P, C);
        for (size_t i = 0; i < P; i++)
            for (size_t c = 0; c < C; c++)
                dst[n * C + c] += part[i * C + c];
    }
}

void style_conv_backward(float *dx, float *dlatent, const float *dy,
                         const float *x, const float *latent, float *g0,
                         float *g1, struct style_conv *s)
{
    size_t pixels = s->h * s->w, low = s->up ? pixels / 4 : pixels;
    size_t B = s->batch;

    memset(s->dst, 0, B * s->in * sizeof *s->dst);
    for (size_t n = 0; n < B; n++) {
        style_finish_backward(g0, s->dd, dy, n, s);
        style_demodulate_backward(s->dd, n, s);
    }
    conv_backward(g1, g0, NULL, s->xu, &s->conv);
    if (s->up)
        rescale_backward(g0, g1, &s->grow);
    const float *dxs = s->up ? g0 : g1;
    style_scale_backward(s->dst, s->part, dxs, x, B, low, s->in);
    style_scale_images(dx, dxs, s->st, B, low, s->in);
    conv_backward(s->dlatent, s->dst, s->st, latent, &s->modulation);
    image_add(dlatent, s->dlatent, B * s->modulation.in);
}

/* ---- the picture --------------------------------------------------------- */

void to_rgb_init(struct to_rgb *t, struct params *ps, const char *name,
                 size_t in, size_t latent, bool first)
{
    char buf[120];
    size_t bias[4] = { 1, 3, 1, 1 };

    memset(t, 0, sizeof *t);
    t->in = in;
    t->first = first;
    style_declare(&t->conv, &t->modulation, ps, name, in, 3, 1, latent);
    t->conv.bias = params_add(ps, nn_name(buf, "%s.bias", name), 4, bias,
                              PARAM_ZERO, 0);
    t->conv.add = true;
}

void to_rgb_plan(struct to_rgb *t, struct nn_plan *p, size_t batch, size_t h,
                 size_t w)
{
    t->batch = batch;
    t->h = h;
    t->w = w;
    linear_plan(&t->modulation, p, batch);
    if (!t->first)
        rescale_plan(&t->grow, p, RESCALE_BILINEAR, batch, h / 2, w / 2, h, w,
                     3);
    t->st = nn_plan_floats(p, batch * t->in);
    t->rgb = nn_plan_floats(p, batch * h * w * 3);
    t->xs = nn_plan_map(p, batch * h * w * t->in);
    conv_plan(&t->conv, p, batch, h, w);
    nn_plan_recycle(p, t->xs);
    if (!nn_plan_backward(p))
        return;
    t->part = nn_plan_floats(p, NN_SUMS * t->in);
    t->dst = nn_plan_floats(p, batch * t->in);
    t->dlatent = nn_plan_floats(p, batch * t->modulation.in);
}

void to_rgb_forward(const float *x, const float *latent,
                    const float *previous, struct to_rgb *t)
{
    const size_t pixels = t->h * t->w;

    conv_forward(t->st, latent, &t->modulation);
    if (t->first)
        memset(t->rgb, 0, t->batch * pixels * 3 * sizeof *t->rgb);
    else
        rescale_forward(t->rgb, previous, &t->grow);
    style_scale_images(t->xs, x, t->st, t->batch, pixels, t->in);
    conv_forward(t->rgb, t->xs, &t->conv);
}

/* In the forward pass: rgb = W (x st) + b + grow(previous). */
void to_rgb_backward(float *dx, float *dlatent, float *dprevious, float *drgb,
                     const float *x, const float *latent, float *g,
                     struct to_rgb *t)
{
    const size_t B = t->batch, pixels = t->h * t->w, C = t->in;

    if (dprevious)
        rescale_backward(dprevious, drgb, &t->grow);
    conv_backward(g, drgb, t->rgb, t->xs, &t->conv);
    memset(t->dst, 0, B * C * sizeof *t->dst);
    style_scale_backward(t->dst, t->part, g, x, B, pixels, C);
    style_scale_images(g, g, t->st, B, pixels, C);
    image_add(dx, g, B * pixels * C);
    conv_backward(t->dlatent, t->dst, t->st, latent, &t->modulation);
    image_add(dlatent, t->dlatent, B * t->modulation.in);
}
