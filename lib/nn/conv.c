/* Convolutions and linear layers: declaration, the choice of who computes the
 * forward pass, weights with a norm folded in, and gradients.  The methods are
 * oneDNN's direct convolution (conv_onednn.c), the same with 8-bit products
 * (int8.c), Winograd's F(4x4,3x3) (winograd.c), im2col with sums in pieces, or
 * of one tap (im2col.c), and dot products in double for a few rows
 * (small_linear.c). */
#include "lib/nn/conv.h"

#include <assert.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/cpu.h"
#include "lib/nn/act.h"
#include "lib/nn/conv_impl.h"
#include "lib/nn/form.h"
#include "lib/nn/image.h"

const char *nn_name(char buf[120], const char *format, ...)
{
    va_list ap;

    va_start(ap, format);
    vsnprintf(buf, 120, format, ap);
    va_end(ap);
    return buf;
}

/* What all kinds have; ndim 2 is a linear layer's weight. */
static void conv_declare(struct conv *c, struct params *ps, const char *name,
                         size_t in, size_t out, size_t kernel, size_t stride,
                         bool bias, int ndim)
{
    char buf[120];

    memset(c, 0, sizeof *c);
    *c = (struct conv){ .ps = ps, .in = in, .out = out, .kernel = kernel,
                        .stride = stride, .bias = NN_NONE, .gamma = NN_NONE };
    size_t dims[4] = { out, in, kernel, kernel };
    c->weight = params_add(ps, nn_name(buf, "%s.weight", name), ndim, dims,
                           PARAM_HE, 1);
    if (bias)
        c->bias = params_add(ps, nn_name(buf, "%s.bias", name), 1, &out,
                             PARAM_ZERO, 0);
}

void conv_init(struct conv *c, struct params *ps, const char *name, size_t in,
               size_t out, size_t kernel, size_t stride, bool bias)
{
    conv_declare(c, ps, name, in, out, kernel, stride, bias, 4);
}

void linear_init(struct conv *c, struct params *ps, const char *name, size_t in,
                 size_t out)
{
    conv_declare(c, ps, name, in, out, 1, 1, true, 2);
}

void deconv_init(struct conv *c, struct params *ps, const char *name,
                 size_t in, size_t out, size_t f)
{
    char buf[120];
    size_t dims[4] = { in, out, f, f };

    memset(c, 0, sizeof *c);
    *c = (struct conv){ .ps = ps, .in = in, .out = f * f * out, .kernel = 1,
                        .stride = 1, .shuffle = f, .gamma = NN_NONE };
    c->weight = params_add(ps, nn_name(buf, "%s.weight", name), 4, dims,
                           PARAM_HE, (float)f);
    c->bias = params_add(ps, nn_name(buf, "%s.bias", name), 1, &out,
                         PARAM_ZERO, 0);
}

/* ---- the methods --------------------------------------------------------- */

/* n pixels with those before them and all that the last window sees. */
static size_t conv_padded(size_t n, size_t before, size_t windows,
                          const struct conv *c)
{
    size_t seen = (windows - 1) * c->stride + c->kernel;

    return seen > n + before ? seen : n + before;
}

/* Quantised weights, and a primitive over them. */
static void conv_plan_int8(struct conv *c, const struct conv_shape *s)
{
    struct conv_impl *im = c->impl;
    struct int8 *q = &im->int8;
    struct conv_shape whole = *s;

    /* the primitive sees a picture that has its padding already */
    int8_plan(q, c, c->plan);
    q->top = s->top;
    q->left = s->left;
    q->h = whole.h = conv_padded(s->h, s->top, s->oh, c);
    q->w = whole.w = conv_padded(s->w, s->left, s->ow, c);
    whole.top = whole.left = whole.bottom = whole.right = 0;
    im->input = dnnl_u8;
    im->weights = dnnl_s8;
    conv_onednn_plan_forward(c, &whole);
    q->at = im->half_at;
}

static void conv_update_int8(struct conv *c, const float *w)
{
    struct conv_impl *im = c->impl;

    int8_update(&im->int8, c, w);
    conv_onednn_reorder(&im->to_fwd, im->w_fwd, im->int8.weight, c);
}

static void conv_forward_int8(float *out, const float *in, struct conv *c)
{
    struct conv_impl *im = c->impl;
    const uint8_t *bytes = int8_input(&im->int8, c, in, im->bias);

    conv_onednn_forward(out, bytes, im->int8.bias, im->int8.scale, c);
}

static void conv_plan_winograd(struct conv *c, const struct conv_shape *s)
{
    (void)s;
    winograd_plan(&c->impl->winograd, c, c->plan);
}

static void conv_update_winograd(struct conv *c, const float *w)
{
    winograd_update(&c->impl->winograd, w, c->impl->bias);
}

static void conv_forward_winograd(float *out, const float *in, struct conv *c)
{
    winograd_forward(out, in, &c->impl->winograd);
}

/* Values of a layer's weights as the primitives see them. */
static size_t conv_weight_count(const struct conv *c)
{
    return c->out * c->in_data * c->kernel * c->kernel;
}

/* The form that takes the fewest cycles of those that the plan's type allows,
 * which for layers that learn is float.  Few rows take as long as reading the
 * weights does. */
static enum form conv_form(const struct conv *c)
{
    static const enum form max[] = { [NN_F32] = FORM_FLOAT,
                                      [NN_FAST] = FORM_WINOGRAD,
                                      [NN_BF16] = FORM_BF16,
                                      [NN_INT8] = FORM_INT8 };
    const struct form_layer l = { c->in_data, c->out, c->kernel, c->stride };
    const struct form_rates r = form_rates();

    return small_linear_wanted(c)
               ? FORM_FLOAT : form_choose(&l, max[nn_plan_type(c->plan)], &r);
}

static bool conv_int8_wanted(const struct conv *c)
{
    return conv_form(c) == FORM_INT8;
}

static bool conv_winograd_wanted(const struct conv *c)
{
    return conv_form(c) == FORM_WINOGRAD && c->act <= ACT_LRELU;
}

bool conv_halves(const struct nn_plan *p)
{
    return nn_plan_backward(p) && p->opt.type == NN_BF16 &&
           nn_type_native(NN_BF16) && cpu_level() == CPU_AVX512;
}

/* Layers that learn in bfloat16 have enough channels to gain by it. */
static bool conv_half_wanted(const struct conv *c)
{
    if (c->half_in || c->half_out || conv_form(c) == FORM_BF16)
        return true;
    return nn_plan_backward(c->plan) && c->plan->opt.type == NN_BF16 &&
           nn_type_native(NN_BF16) && c->in >= 16 && c->out >= 16 &&
           c->batch * c->h * c->w >= 256;
}

static void conv_plan_half(struct conv *c, const struct conv_shape *s)
{
    c->impl->input = c->impl->weights = dnnl_bf16;
    conv_onednn_plan_forward(c, s);
}

static bool conv_direct_wanted(const struct conv *c)
{
    (void)c;
    return true;
}

static void conv_update_direct(struct conv *c, const float *w)
{
    conv_onednn_reorder(&c->impl->to_fwd, c->impl->w_fwd, w, c);
}

/* By the library's primitive, its input brought to the type it takes. */
static void conv_forward_direct(float *out, const float *in, struct conv *c)
{
    void *half = c->plan->scratch + c->impl->half_at;
    const bool narrows = c->impl->input == dnnl_bf16 && !c->half_in;

    if (narrows)
        image_to_bf16(half, in, c->batch * c->h * c->w * c->in_data);
    conv_onednn_forward(out, narrows ? half : in, c->impl->bias, NULL, c);
}

/* In the order in which they are asked; the last takes any layer. */
static const struct conv_method conv_methods[] = {
    { conv_int8_wanted, conv_plan_int8, conv_update_int8, conv_forward_int8 },
    { conv_half_wanted, conv_plan_half, conv_update_direct,
      conv_forward_direct },
    { small_linear_wanted, small_linear_plan, small_linear_update,
      small_linear_forward },
    { im2col_wanted, im2col_plan, im2col_update, im2col_forward },
    { conv_winograd_wanted, conv_plan_winograd, conv_update_winograd,
      conv_forward_winograd },
    { conv_direct_wanted, conv_onednn_plan_forward, conv_update_direct,
      conv_forward_direct },
};

/* ---- planning ------------------------------------------------------------ */

/* Along one axis of `size` pixels: the padding before and after, and how many
 * outputs there are. */
static void conv_pad_axis(size_t *before, size_t *after, size_t *out,
                          size_t size, const struct conv *c)
{
    size_t k = c->kernel, s = c->stride;

    if (c->pad == CONV_SAME) {
        *out = (size + s - 1) / s;
        size_t need = (*out - 1) * s + k;
        size_t total = need > size ? need - size : 0;
        *before = total / 2;
        *after = total - *before;
    } else {
        *before = c->pad == CONV_HALF ? k / 2 : 0;
        *out = (size + 2 * *before - k) / s + 1;
        size_t need = (*out - 1) * s + k;
        *after = need > size + *before ? need - size - *before : 0;
    }
}

/* A planned layer into one that is only declared. */
static void conv_layer_release(void *layer)
{
    struct conv *c = layer;
    struct conv_impl *im = c->impl;

    for (size_t i = 0; i < CONV_BANDS; i++) {
        nn_call_release(&im->fwd.band[i].call);
        nn_call_release(&im->bwd_data.band[i].call);
    }
    nn_call_release(&im->to_fwd);
    nn_call_release(&im->to_bwd);
    nn_call_release(&im->add_dw);
    for (size_t i = 0; i < im->parts; i++)
        nn_call_release(&im->part[i].call);
    free(im);
    c->impl = NULL;
}

static void conv_layer_update(void *layer)
{
    conv_update(layer);
}

void conv_plan(struct conv *c, struct nn_plan *p, size_t batch, size_t h,
               size_t w)
{
    const struct conv_method *m = conv_methods;

    if (p->err.code)
        return;
    struct conv_impl *im = calloc(1, sizeof *im);
    struct conv_shape s = { .n = batch, .h = h, .w = w };
    if (!im || !nn_engine()) {
        free(im);
        nn_plan_fail(p, EX_OSERR, "oneDNN could not start");
        return;
    }
    assert(!c->impl);
    c->impl = im;
    nn_plan_layer(p, (struct nn_layer){c, conv_layer_update,
                                       conv_layer_release});
    if (p->err.code)
        return;
    c->plan = p;
    c->in_data = c->in_data ? c->in_data : c->in;
    conv_pad_axis(&s.top, &s.bottom, &s.oh, h, c);
    conv_pad_axis(&s.left, &s.right, &s.ow, w, c);
    c->batch = batch;
    c->h = h;
    c->w = w;
    c->oh = s.oh;
    c->ow = s.ow;
    assert(!nn_plan_backward(p) || c->act <= ACT_LRELU);
    assert(!c->half_out || (!c->add && !c->shuffle && c->act <= ACT_RELU));
    im->input = im->weights = dnnl_f32;
    while (!m->wanted(c))
        m++;
    im->method = m;
    m->plan(c, &s);
    im->bias = nn_plan_floats(p, c->out);
    im->stage = nn_plan_map(p, conv_weight_count(c));
    nn_plan_recycle(p, im->stage);
    if (nn_plan_backward(p)) {
        im->sums = nn_plan_floats(p, (NN_SUMS + 1) * c->out);
        if (!c->no_din)
            conv_onednn_plan_backward_data(c, &s);
        if (!c->ps->tensor[c->weight].frozen)
            conv_onednn_plan_backward_weights(c, &s);
    }
}

void linear_plan(struct conv *c, struct nn_plan *p, size_t rows)
{
    conv_plan(c, p, 1, rows, 1);
}

struct winograd *conv_winograd(struct conv *c)
{
    return c->impl && c->impl->method->plan == conv_plan_winograd
               ? &c->impl->winograd : NULL;
}

/* ---- running ------------------------------------------------------------- */

/* stage (f*f*O,in) <-> w (in,O,f,f) of a transposed convolution; back adds. */
static void conv_shuffle_weights(const struct conv *c, float *w, bool back)
{
    size_t ff = c->shuffle * c->shuffle, O = c->out / ff;

    for (size_t d = 0; d < ff; d++)
        for (size_t o = 0; o < O; o++)
            for (size_t i = 0; i < c->in; i++) {
                float *s = c->impl->stage + (d * O + o) * c->in + i;
                float *p = w + (i * O + o) * ff + d;

                if (back)
                    *p += *s;
                else
                    *s = *p;
            }
}

/* The weights and the bias of a transposed convolution, as those of a
 * convolution to f*f times the channels. */
static const float *conv_shuffled_weights(struct conv *c)
{
    size_t O = c->out / (c->shuffle * c->shuffle);

    for (size_t o = 0; o < c->out; o++)
        c->impl->bias[o] = param_w(c->ps, c->bias)[o % O];
    conv_shuffle_weights(c, param_w(c->ps, c->weight), false);
    return c->impl->stage;
}

/* stage <- weights with the norm's scale, channels padded to in_data. */
static const float *conv_staged_weights(struct conv *c)
{
    const struct batch_norm *bn = c->norm;
    struct conv_impl *im = c->impl;
    const float *w = c->from ? c->from : param_w(c->ps, c->weight);
    const float *b = c->bias == NN_NONE ? NULL : param_w(c->ps, c->bias);
    size_t taps = c->kernel * c->kernel;

    for (size_t o = 0; o < c->out; o++)
        im->bias[o] = b ? b[o] : 0;
    if (!bn && c->in_data == c->in && c->gamma == NN_NONE)
        return w;
    for (size_t o = 0; o < c->out; o++) {
        float scale = 1;

        if (c->gamma != NN_NONE) {
            scale = param_w(c->ps, c->gamma)[o];
            im->bias[o] *= scale;
        } else if (bn) {
            const struct params *ps = c->ps;

            scale = param_w(ps, bn->weight)[o] /
                    sqrtf(param_w(ps, bn->var)[o] + bn->eps);
            im->bias[o] = param_w(ps, bn->bias)[o] +
                          (im->bias[o] - param_w(ps, bn->mean)[o]) * scale;
        }
        float *to = im->stage + o * c->in_data * taps;
        for (size_t i = 0; i < c->in * taps; i++)
            to[i] = w[o * c->in * taps + i] * scale;
        memset(to + c->in * taps, 0,
               (c->in_data - c->in) * taps * sizeof *to);
    }
    return im->stage;
}

void conv_update(struct conv *c)
{
    struct conv_impl *im = c->impl;
    const float *w = c->shuffle ? conv_shuffled_weights(c)
                                : conv_staged_weights(c);

    im->method->update(c, w);
    if (im->bwd_data.count)
        conv_onednn_reorder(&im->to_bwd, im->w_bwd, w, c);
}

void conv_forward(void *out, const void *in, struct conv *c)
{
    c->impl->method->forward(out, in, c);
}

/* dw (out,in_data,k,k) += the weights' gradient. */
static void conv_add_gradient(float *dw, const void *dout, const void *in,
                              struct conv *c)
{
    assert(c->impl->parts);      /* frozen when it was planned, now no more */
    const float *sum = conv_onednn_backward_weights(dout, in, c);

    conv_onednn_reorder(&c->impl->add_dw, dw, sum, c);
}

/* The weights' gradient, added to ps->g in the checkpoint's layout. */
static void conv_backward_weights(struct conv *c, const void *dout,
                                  const void *in)
{
    struct conv_impl *im = c->impl;
    float *g = c->from_g ? c->from_g : param_g(c->ps, c->weight);

    if (c->in_data == c->in && !c->shuffle) {
        conv_add_gradient(g, dout, in, c);
        return;
    }
    size_t taps = c->kernel * c->kernel;
    memset(im->stage, 0, conv_weight_count(c) * sizeof *im->stage);
    conv_add_gradient(im->stage, dout, in, c);
    if (c->shuffle)
        conv_shuffle_weights(c, g, true);
    for (size_t o = 0; o < c->out && !c->shuffle; o++)
        for (size_t k = 0; k < c->in * taps; k++)
            g[o * c->in * taps + k] += im->stage[o * c->in_data * taps + k];
}

/* dout becomes the gradient before the activation; db (out) += its sum, unless
 * NULL. */
static void conv_act_backward(float *db, void *dout, const void *out,
                              struct conv *c)
{
    const size_t rows = c->batch * c->oh * c->ow;

    if (c->half_out)
        act_bias_backward_half(db, dout, c->impl->sums, out, c->act, rows,
                               c->out);
    else
        act_bias_backward(db, dout, c->impl->sums, out, c->act, rows, c->out);
}

void conv_backward(void *din, void *dout, const void *out, const void *in,
                   struct conv *c)
{
    bool learns = c->bias != NN_NONE && !c->ps->tensor[c->bias].frozen;
    float *db = learns ? param_g(c->ps, c->bias) : NULL;
    float *each = c->impl->sums + NN_SUMS * c->out;

    if (c->shuffle && learns) {
        memset(each, 0, c->out * sizeof *each);
        db = each;
    }
    conv_act_backward(db, dout, out, c);
    if (c->shuffle && learns)
        for (size_t o = 0, O = c->out / (c->shuffle * c->shuffle);
             o < c->out; o++)
            param_g(c->ps, c->bias)[o % O] += each[o];
    if (!c->ps->tensor[c->weight].frozen)
        conv_backward_weights(c, dout, in);
    if (din)
        conv_onednn_backward_data(din, dout, c);
}

void conv_backward_input(void *din, void *dout, const void *out,
                         struct conv *c)
{
    conv_act_backward(NULL, dout, out, c);
    conv_onednn_backward_data(din, dout, c);
}
