#include "lib/nn/conv.h"

#include <assert.h>
#include <math.h>
#include <omp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/nn/engine.h"
#include "lib/nn/image.h"
#include "lib/nn/int8.h"
#include "lib/nn/patch.h"
#include "lib/nn/thin.h"
#include "lib/nn/winograd.h"

/* One share of the weight gradient: some images, or a band of one. */
struct part {
    struct nn_call call;
    size_t in_at, out_at;        /* offsets of its first values */
    float *dw;                   /* in oneDNN's layout */
};

/* Who computes the forward. */
enum method { ONEDNN, INT8, WINOGRAD, PATCH, THIN };  /* INT8: oneDNN too */

struct conv_impl {
    enum method kind;
    struct nn_call fwd, bwd_data, to_fwd, to_bwd, add_dw;
    struct winograd wino;
    struct patch patch;
    struct thin thin;
    struct int8 int8;
    const char *name;
    void *w_fwd, *w_bwd;         /* weights as the primitives want them */
    float *bias;                 /* (out), folded */
    float *stage;                /* (out,in_data,k,k), folded or padded */
    float *sums;                 /* (NN_SUMS+1,out): bias gradient's parts */
    size_t half_at;              /* of the input as bf16 or bytes, in the
                                  * scratch */
    size_t parts, dw_count;
    size_t scratch;              /* bytes for one part */
    struct part part[NN_PARTS];
};

const char *nn_name(char buf[120], const char *format, ...)
{
    va_list ap;
    va_start(ap, format);
    vsnprintf(buf, 120, format, ap);
    va_end(ap);
    return buf;
}

static void declare(struct conv *c, struct params *ps, const char *name,
                    size_t in, size_t out, size_t kernel, size_t stride,
                    bool bias, int ndim)
{
    char buf[120];
    memset(c, 0, sizeof *c);
    *c = (struct conv){ .ps = ps, .in = in, .out = out, .kernel = kernel,
                        .stride = stride, .bias = NN_NONE, .gamma = NN_NONE };
    size_t dims[4] = { out, in, kernel, kernel };
    c->weight = params_add(ps, nn_name(buf, "%s.weight", name), ndim, dims,
                           PARAM_HE, 1.0f);
    if (bias)
        c->bias = params_add(ps, nn_name(buf, "%s.bias", name), 1, &out,
                             PARAM_ZERO, 0.0f);
}

void conv_init(struct conv *c, struct params *ps, const char *name, size_t in,
               size_t out, size_t kernel, size_t stride, bool bias)
{
    declare(c, ps, name, in, out, kernel, stride, bias, 4);
}

void linear_init(struct conv *c, struct params *ps, const char *name,
                 size_t in, size_t out, bool bias)
{
    declare(c, ps, name, in, out, 1, 1, bias, 2);
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
                         PARAM_ZERO, 0.0f);
}

/* ---- describing the work to oneDNN ----------------------------------------
 */

/* A convolution of n images h x w, padded, to oh x ow. */
struct shape {
    size_t n, h, w, oh, ow;
    size_t top, left, bottom, right;
};

static void pad_axis(size_t *before, size_t *after, size_t *out, size_t size,
                     const struct conv *c)
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

static dnnl_data_type_t input_type(const struct conv *c)
{
    if (c->impl->kind == INT8)
        return dnnl_u8;
    return c->plan->opt.type == NN_BF16 && nn_bf16_products() ? dnnl_bf16
                                                              : dnnl_f32;
}

static dnnl_data_type_t weight_type(const struct conv *c)
{
    return c->impl->kind == INT8 ? dnnl_s8 : input_type(c);
}

struct mds {
    dnnl_memory_desc_t src, wei, bia, dst;
    dnnl_dims_t stride, pad0, pad1;
};

static void describe(struct mds *m, const struct conv *c,
                     const struct shape *s)
{
    dnnl_dims_t src = { s->n, c->in_data, s->h, s->w };
    dnnl_dims_t wei = { c->out, c->in_data, c->kernel, c->kernel };
    dnnl_dims_t dst = { s->n, c->out, s->oh, s->ow };
    dnnl_dims_t bia = { c->out };
    memset(m, 0, sizeof *m);
    dnnl_memory_desc_init_by_tag(&m->src, 4, src, input_type(c), dnnl_nhwc);
    dnnl_memory_desc_init_by_tag(&m->wei, 4, wei, weight_type(c),
                                 dnnl_format_tag_any);
    dnnl_memory_desc_init_by_tag(&m->bia, 1, bia, dnnl_f32, dnnl_a);
    dnnl_memory_desc_init_by_tag(&m->dst, 4, dst, dnnl_f32, dnnl_nhwc);
    m->stride[0] = m->stride[1] = c->stride;
    m->pad0[0] = s->top;
    m->pad0[1] = s->left;
    m->pad1[0] = s->bottom;
    m->pad1[1] = s->right;
}

/* (1,out,1,1): what multiplies each channel's sum of 8-bit products. */
static void describe_scale(dnnl_memory_desc_t *md, const struct conv *c)
{
    dnnl_dims_t dims = { 1, c->out, 1, 1 };
    dnnl_memory_desc_init_by_tag(md, 4, dims, dnnl_f32, dnnl_nchw);
}

static dnnl_primitive_attr_t attributes(const struct conv *c, bool forward)
{
    static const dnnl_alg_kind_t alg[] = {
        [ACT_RELU] = dnnl_eltwise_relu, [ACT_LRELU] = dnnl_eltwise_relu,
        [ACT_HARDSWISH] = dnnl_eltwise_hardswish,
        [ACT_SIGMOID] = dnnl_eltwise_logistic, [ACT_TANH] = dnnl_eltwise_tanh,
        [ACT_GELU] = dnnl_eltwise_gelu_erf
    };
    dnnl_primitive_attr_t attr;
    dnnl_post_ops_t post;
    dnnl_primitive_attr_create(&attr);
    dnnl_primitive_attr_set_scratchpad_mode(attr, dnnl_scratchpad_mode_user);
    if (!forward)
        return attr;
    dnnl_post_ops_create(&post);
    if (c->impl->kind == INT8) {
        dnnl_memory_desc_t scale;
        describe_scale(&scale, c);
        dnnl_post_ops_append_binary(post, dnnl_binary_mul, &scale);
    }
    if (c->add)
        dnnl_post_ops_append_sum(post, 1.0f);
    if (c->act != ACT_NONE)
        dnnl_post_ops_append_eltwise(post, 1.0f, alg[c->act],
                                     c->act == ACT_LRELU ? ACT_SLOPE : 0, 0);
    dnnl_primitive_attr_set_post_ops(attr, post);
    dnnl_post_ops_destroy(post);
    return attr;
}

enum kind { FORWARD, BACKWARD_DATA, BACKWARD_WEIGHTS };

/* The primitive descriptor of one direction; NULL after telling the plan. */
static dnnl_primitive_desc_t primitive(const struct conv *c, enum kind kind,
                                       const struct shape *s)
{
    struct nn_plan *p = c->plan;
    struct mds m;
    dnnl_convolution_desc_t d;
    dnnl_primitive_desc_t pd = NULL, hint = NULL;
    bool bwd = nn_plan_backward(p);
    describe(&m, c, s);
    dnnl_primitive_attr_t attr = attributes(c, kind == FORWARD);
    dnnl_status_t ok = dnnl_convolution_forward_desc_init(
        &d, bwd ? dnnl_forward_training : dnnl_forward_inference,
        dnnl_convolution_direct, &m.src, &m.wei,
        kind == FORWARD ? &m.bia : NULL, &m.dst, m.stride, m.pad0, m.pad1);
    if (!ok)
        ok = dnnl_primitive_desc_create(&pd, &d, attr, nn_engine(), NULL);
    if (!ok && kind != FORWARD) {
        hint = pd;
        pd = NULL;
        ok = kind == BACKWARD_DATA
            ? dnnl_convolution_backward_data_desc_init(
                  &d, dnnl_convolution_direct, &m.src, &m.wei, &m.dst,
                  m.stride, m.pad0, m.pad1)
            : dnnl_convolution_backward_weights_desc_init(
                  &d, dnnl_convolution_direct, &m.src, &m.wei, NULL, &m.dst,
                  m.stride, m.pad0, m.pad1);
        if (!ok)
            ok = dnnl_primitive_desc_create(&pd, &d, attr, nn_engine(), hint);
        dnnl_primitive_desc_destroy(hint);
    }
    dnnl_primitive_attr_destroy(attr);
    if (ok) {
        nn_plan_fail(p, EX_SOFTWARE, "oneDNN has no convolution %zu -> %zu, "
                     "%zux%zu, of %zux%zu (%s)", c->in, c->out, c->kernel,
                     c->kernel, s->h, s->w, nn_type_name(p->opt.type));
        return NULL;
    }
    return pd;
}

static const dnnl_memory_desc_t *query(const_dnnl_primitive_desc_t pd,
                                       dnnl_query_t what)
{
    return dnnl_primitive_desc_query_md(pd, what, 0);
}

/* ---- planning -------------------------------------------------------------
 */

/* A reorder of weights between the checkpoint's layout and oneDNN's. */
static void plan_reorder(struct nn_call *call, const struct conv *c,
                         const dnnl_memory_desc_t *md, bool back)
{
    struct nn_plan *p = c->plan;
    dnnl_memory_desc_t plain;
    dnnl_dims_t dims = { c->out, c->in_data, c->kernel, c->kernel };
    dnnl_primitive_desc_t pd = NULL;
    dnnl_primitive_attr_t attr;
    dnnl_post_ops_t post;
    dnnl_memory_desc_init_by_tag(&plain, 4, dims, c->impl->kind == INT8
                                 ? dnnl_s8 : dnnl_f32, dnnl_oihw);
    dnnl_primitive_attr_create(&attr);
    dnnl_primitive_attr_set_scratchpad_mode(attr, dnnl_scratchpad_mode_user);
    dnnl_post_ops_create(&post);
    if (back)
        dnnl_post_ops_append_sum(post, 1.0f);
    dnnl_primitive_attr_set_post_ops(attr, post);
    if (dnnl_reorder_primitive_desc_create(&pd, back ? md : &plain,
                                           nn_engine(), back ? &plain : md,
                                           nn_engine(), attr)) {
        nn_plan_fail(p, EX_SOFTWARE, "oneDNN cannot reorder weights");
    } else {
        nn_call_init(call, pd, p);
        nn_call_arg(call, DNNL_ARG_FROM, back ? md : &plain, p);
        nn_call_arg(call, DNNL_ARG_TO, back ? &plain : md, p);
        nn_plan_scratch(p, nn_call_scratch(call, pd, p));
        dnnl_primitive_desc_destroy(pd);
    }
    dnnl_post_ops_destroy(post);
    dnnl_primitive_attr_destroy(attr);
}

static void plan_forward(struct conv *c, const struct shape *s)
{
    struct conv_impl *im = c->impl;
    struct nn_plan *p = c->plan;
    dnnl_primitive_desc_t pd = primitive(c, FORWARD, s);
    if (!pd)
        return;
    nn_call_init(&im->fwd, pd, p);
    nn_call_arg(&im->fwd, DNNL_ARG_SRC, query(pd, dnnl_query_src_md), p);
    nn_call_arg(&im->fwd, DNNL_ARG_WEIGHTS,
                query(pd, dnnl_query_weights_md), p);
    nn_call_arg(&im->fwd, DNNL_ARG_BIAS,
                dnnl_primitive_desc_query_md(pd, dnnl_query_weights_md, 1), p);
    nn_call_arg(&im->fwd, DNNL_ARG_DST, query(pd, dnnl_query_dst_md), p);
    size_t scratch = nn_call_scratch(&im->fwd, pd, p);
    im->half_at = (scratch + 4095) & ~(size_t)4095;
    if (im->kind == INT8) {
        dnnl_memory_desc_t scale;
        describe_scale(&scale, c);
        nn_call_arg(&im->fwd, DNNL_ARG_ATTR_MULTIPLE_POST_OP(0) |
                    DNNL_ARG_SRC_1, &scale, p);
        im->int8.at = im->half_at;
        scratch = im->half_at + int8_input_size(&im->int8, c);
    } else if (p->opt.type == NN_BF16) {
        size_t each = nn_bf16_products() ? sizeof(uint16_t) : sizeof(float);
        scratch = im->half_at + each * c->batch * c->h * c->w * c->in_data;
    }
    nn_plan_scratch(p, scratch);
    const dnnl_memory_desc_t *md = query(pd, dnnl_query_weights_md);
    im->w_fwd = nn_plan_bytes(p, dnnl_memory_desc_get_size(md));
    plan_reorder(&im->to_fwd, c, md, false);
    dnnl_primitive_desc_query(pd, dnnl_query_impl_info_str, 0, &im->name);
    dnnl_primitive_desc_destroy(pd);
}

static void plan_backward_data(struct conv *c, const struct shape *s)
{
    struct conv_impl *im = c->impl;
    struct nn_plan *p = c->plan;
    dnnl_primitive_desc_t pd = primitive(c, BACKWARD_DATA, s);
    if (!pd)
        return;
    nn_call_init(&im->bwd_data, pd, p);
    nn_call_arg(&im->bwd_data, DNNL_ARG_DIFF_SRC,
                query(pd, dnnl_query_diff_src_md), p);
    nn_call_arg(&im->bwd_data, DNNL_ARG_WEIGHTS,
                query(pd, dnnl_query_weights_md), p);
    nn_call_arg(&im->bwd_data, DNNL_ARG_DIFF_DST,
                query(pd, dnnl_query_diff_dst_md), p);
    nn_plan_scratch(p, nn_call_scratch(&im->bwd_data, pd, p));
    const dnnl_memory_desc_t *md = query(pd, dnnl_query_weights_md);
    im->w_bwd = nn_plan_bytes(p, dnnl_memory_desc_get_size(md));
    plan_reorder(&im->to_bwd, c, md, false);
    dnnl_primitive_desc_destroy(pd);
}

/* Rows [y0,y1) of image i of the output as a convolution of its own. */
static struct shape band(const struct shape *s, const struct conv *c,
                         size_t y0, size_t y1, size_t *first)
{
    struct shape b = *s;
    size_t lo = y0 * c->stride, hi = (y1 - 1) * c->stride + c->kernel;
    b.n = 1;
    b.oh = y1 - y0;
    b.top = lo < s->top ? s->top - lo : 0;
    *first = lo < s->top ? 0 : lo - s->top;
    size_t end = hi - s->top;
    b.bottom = end > s->h ? end - s->h : 0;
    b.h = (end > s->h ? s->h : end) - *first;
    return b;
}

static void plan_part(struct conv *c, struct part *part, const struct shape *s,
                      bool first)
{
    struct conv_impl *im = c->impl;
    struct nn_plan *p = c->plan;
    dnnl_primitive_desc_t pd = primitive(c, BACKWARD_WEIGHTS, s);
    if (!pd)
        return;
    const dnnl_memory_desc_t *md = query(pd, dnnl_query_diff_weights_md);
    nn_call_init(&part->call, pd, p);
    nn_call_arg(&part->call, DNNL_ARG_SRC, query(pd, dnnl_query_src_md), p);
    nn_call_arg(&part->call, DNNL_ARG_DIFF_DST,
                query(pd, dnnl_query_diff_dst_md), p);
    nn_call_arg(&part->call, DNNL_ARG_DIFF_WEIGHTS, md, p);
    size_t bytes = nn_call_scratch(&part->call, pd, p);
    bytes = (bytes + 4095) & ~(size_t)4095;
    if (bytes > im->scratch)
        im->scratch = bytes;
    if (first) {
        im->dw_count = dnnl_memory_desc_get_size(md) / sizeof(float);
        plan_reorder(&im->add_dw, c, md, true);
    } else if (dnnl_memory_desc_get_size(md) != im->dw_count * sizeof(float)) {
        nn_plan_fail(p, EX_SOFTWARE, "parts of a gradient differ in layout");
    }
    dnnl_primitive_desc_destroy(pd);
}

/* Split the weight gradient over images, or images' bands, and make every
 * part a primitive for one thread. */
static void plan_backward_weights(struct conv *c, const struct shape *s)
{
    struct conv_impl *im = c->impl;
    int threads = omp_get_max_threads();
    size_t bands = s->n < NN_PARTS ? NN_PARTS / s->n : 1;
    if (s->oh < 4 * bands)
        bands = 1;
    im->parts = bands > 1 ? s->n * bands : s->n < NN_PARTS ? s->n : NN_PARTS;
    omp_set_num_threads(1);
    for (size_t i = 0; i < im->parts; i++) {
        struct part *part = &im->part[i];
        struct shape b = *s;
        size_t image = i * s->n / im->parts, first = 0, y0 = 0;
        if (bands > 1) {
            size_t k = i % bands;
            image = i / bands;
            y0 = k * s->oh / bands;
            b = band(s, c, y0, (k + 1) * s->oh / bands, &first);
        } else {
            b.n = (i + 1) * s->n / im->parts - image;
        }
        part->in_at = (image * s->h + first) * s->w * c->in_data;
        part->out_at = (image * s->oh + y0) * s->ow * c->out;
        plan_part(c, part, &b, i == 0);
    }
    omp_set_num_threads(threads);
    for (size_t i = 0; i < im->parts; i++)
        im->part[i].dw = nn_plan_floats(c->plan, im->dw_count);
    nn_plan_scratch(c->plan, im->scratch * im->parts);
}

/* n pixels with those before them and all that the last window sees. */
static size_t padded(size_t n, size_t before, size_t windows,
                     const struct conv *c)
{
    size_t seen = (windows - 1) * c->stride + c->kernel;
    return seen > n + before ? seen : n + before;
}

/* The primitive sees a picture that has its padding already. */
static void plan_int8(struct conv *c, const struct shape *s)
{
    struct int8 *q = &c->impl->int8;
    struct shape whole = *s;
    q->top = s->top;
    q->left = s->left;
    q->h = whole.h = padded(s->h, s->top, s->oh, c);
    q->w = whole.w = padded(s->w, s->left, s->ow, c);
    whole.top = whole.left = whole.bottom = whole.right = 0;
    int8_plan(q, c, c->plan);
    plan_forward(c, &whole);
}

void conv_plan(struct conv *c, struct nn_plan *p, size_t batch, size_t h,
               size_t w)
{
    if (p->err.code)
        return;
    struct conv_impl *im = calloc(1, sizeof *im);
    struct shape s = { .n = batch, .h = h, .w = w };
    if (!im || !nn_engine()) {
        free(im);
        nn_plan_fail(p, EX_OSERR, "oneDNN could not start");
        return;
    }
    conv_release(c);
    c->impl = im;
    c->plan = p;
    c->in_data = c->in_data ? c->in_data : c->in;
    pad_axis(&s.top, &s.bottom, &s.oh, h, c);
    pad_axis(&s.left, &s.right, &s.ow, w, c);
    c->batch = batch;
    c->h = h;
    c->w = w;
    c->oh = s.oh;
    c->ow = s.ow;
    assert(!nn_plan_backward(p) || c->act <= ACT_LRELU);
    if (int8_wanted(c)) {
        im->kind = INT8;
        plan_int8(c, &s);
    } else if (thin_wanted(c)) {
        thin_plan(&im->thin, c, p);
        im->kind = THIN;
        im->name = "thin";
    } else if (patch_wanted(c)) {
        patch_plan(&im->patch, c, p);
        im->kind = PATCH;
        im->name = "patch";
    } else if (winograd_wanted(c)) {
        im->kind = WINOGRAD;
        winograd_plan(&im->wino, c, p);
        im->name = "winograd";
    } else {
        plan_forward(c, &s);
    }
    im->bias = nn_plan_floats(p, c->out);
    im->stage = nn_plan_floats(p, c->out * c->in_data * c->kernel * c->kernel);
    if (nn_plan_backward(p)) {
        im->sums = nn_plan_floats(p, (NN_SUMS + 1) * c->out);
        if (!c->no_din)
            plan_backward_data(c, &s);
        plan_backward_weights(c, &s);
    }
}

void linear_plan(struct conv *c, struct nn_plan *p, size_t rows)
{
    conv_plan(c, p, 1, rows, 1);
}

void conv_release(struct conv *c)
{
    struct conv_impl *im = c->impl;
    if (!im)
        return;
    nn_call_release(&im->fwd);
    nn_call_release(&im->bwd_data);
    nn_call_release(&im->to_fwd);
    nn_call_release(&im->to_bwd);
    nn_call_release(&im->add_dw);
    for (size_t i = 0; i < im->parts; i++)
        nn_call_release(&im->part[i].call);
    free(im);
    c->impl = NULL;
}

const char *conv_kernel(const struct conv *c)
{
    return c->impl && c->impl->name ? c->impl->name : "none";
}

/* ---- running --------------------------------------------------------------
 */

/* stage (f*f*O,in) <-> w (in,O,f,f) of a transposed convolution; back adds. */
static void shuffle_weights(const struct conv *c, float *w, bool back)
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

static const float *shuffled_weights(struct conv *c)
{
    size_t O = c->out / (c->shuffle * c->shuffle);
    for (size_t o = 0; o < c->out; o++)
        c->impl->bias[o] = param_w(c->ps, c->bias)[o % O];
    shuffle_weights(c, param_w(c->ps, c->weight), false);
    return c->impl->stage;
}

/* stage <- weights with the norm's scale, channels padded to in_data. */
static const float *staged_weights(struct conv *c, const struct batch_norm *bn)
{
    struct conv_impl *im = c->impl;
    const float *w = c->from ? c->from : param_w(c->ps, c->weight);
    const float *b = c->bias == NN_NONE ? NULL : param_w(c->ps, c->bias);
    size_t taps = c->kernel * c->kernel;
    for (size_t o = 0; o < c->out; o++)
        im->bias[o] = b ? b[o] : 0.0f;
    if (!bn && c->in_data == c->in && c->gamma == NN_NONE)
        return w;
    for (size_t o = 0; o < c->out; o++) {
        float scale = 1.0f;
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
    }
    return im->stage;
}

static void reorder(struct nn_call *call, void *to, const void *from,
                    void *scratch)
{
    nn_call_set(call, 0, from);
    nn_call_set(call, 1, to);
    nn_call_set(call, 2, scratch);
    nn_call_run(call);
}

void conv_update(struct conv *c, const struct batch_norm *bn)
{
    struct conv_impl *im = c->impl;
    const float *w = c->shuffle ? shuffled_weights(c) : staged_weights(c, bn);
    if (im->kind == INT8) {
        int8_update(&im->int8, c, w);
        reorder(&im->to_fwd, im->w_fwd, im->int8.weight, c->plan->scratch);
    } else if (im->kind == ONEDNN) {
        if (c->plan->opt.type == NN_BF16 && !nn_bf16_products()) {
            image_round_bf16(im->stage, w, c->out * c->in_data * c->kernel *
                                               c->kernel);
            w = im->stage;
        }
        reorder(&im->to_fwd, im->w_fwd, w, c->plan->scratch);
    } else if (im->kind == WINOGRAD) {
        winograd_update(&im->wino, w, im->bias);
    } else if (im->kind == THIN) {
        thin_update(&im->thin, w, im->bias);
    } else {
        patch_update(&im->patch, w, im->bias);
    }
    if (im->bwd_data.prim)
        reorder(&im->to_bwd, im->w_bwd, w, c->plan->scratch);
}

void conv_forward(float *out, const float *in, struct conv *c)
{
    struct conv_impl *im = c->impl;
    const void *src = in;
    const float *bias = im->bias;
    if (im->kind == WINOGRAD) {
        winograd_forward(out, in, &im->wino);
        return;
    }
    if (im->kind == PATCH) {
        patch_forward(out, in, &im->patch);
        return;
    }
    if (im->kind == THIN) {
        thin_forward(out, in, &im->thin);
        return;
    }
    if (im->kind == INT8) {
        src = int8_input(&im->int8, c, in, im->bias);
        bias = im->int8.bias;
        nn_call_set(&im->fwd, 5, im->int8.scale);
    } else if (c->plan->opt.type == NN_BF16) {
        void *half = c->plan->scratch + im->half_at;
        size_t count = c->batch * c->h * c->w * c->in_data;
        if (nn_bf16_products())
            image_to_bf16(half, in, count);
        else
            image_round_bf16(half, in, count);
        src = half;
    }
    nn_call_set(&im->fwd, 0, src);
    nn_call_set(&im->fwd, 1, im->w_fwd);
    nn_call_set(&im->fwd, 2, bias);
    nn_call_set(&im->fwd, 3, out);
    nn_call_set(&im->fwd, 4, c->plan->scratch);
    nn_call_run(&im->fwd);
}

/* Each part on one thread; then the parts in order, then into ps->g. */
static void weight_gradient(struct conv *c, const float *dout, const float *in)
{
    struct conv_impl *im = c->impl;
#pragma omp parallel for schedule(static, 1)
    for (size_t i = 0; i < im->parts; i++) {
        struct part *part = &im->part[i];
        nn_call_set(&part->call, 0, in + part->in_at);
        nn_call_set(&part->call, 1, dout + part->out_at);
        nn_call_set(&part->call, 2, part->dw);
        nn_call_set(&part->call, 3, c->plan->scratch + i * im->scratch);
        nn_call_run(&part->call);
    }
    float *sum = im->part[0].dw;
    for (size_t i = 1; i < im->parts; i++)
        for (size_t k = 0; k < im->dw_count; k++)
            sum[k] += im->part[i].dw[k];
    float *g = param_g(c->ps, c->weight);
    if (c->in_data == c->in && !c->shuffle) {
        reorder(&im->add_dw, g, sum, c->plan->scratch);
        return;
    }
    size_t taps = c->kernel * c->kernel;
    memset(im->stage, 0, c->out * c->in_data * taps * sizeof *im->stage);
    reorder(&im->add_dw, im->stage, sum, c->plan->scratch);
    if (c->shuffle)
        shuffle_weights(c, g, true);
    for (size_t o = 0; o < c->out && !c->shuffle; o++)
        for (size_t k = 0; k < c->in * taps; k++)
            g[o * c->in * taps + k] += im->stage[o * c->in_data * taps + k];
    memset(im->stage, 0, c->out * c->in_data * taps * sizeof *im->stage);
}

void conv_backward(float *din, float *dout, const float *out, const float *in,
                   struct conv *c)
{
    struct conv_impl *im = c->impl;
    float *db = c->bias == NN_NONE ? NULL : param_g(c->ps, c->bias);
    float *each = im->sums + NN_SUMS * c->out;
    if (c->shuffle) {
        memset(each, 0, c->out * sizeof *each);
        db = each;
    }
    act_bias_backward(db, dout, im->sums, out, c->act,
                      c->batch * c->oh * c->ow, c->out);
    if (c->shuffle)
        for (size_t o = 0, O = c->out / (c->shuffle * c->shuffle);
             o < c->out; o++)
            param_g(c->ps, c->bias)[o % O] += each[o];
    if (!c->ps->tensor[c->weight].frozen)
        weight_gradient(c, dout, in);
    if (!din)
        return;
    assert(im->bwd_data.prim);
    nn_call_set(&im->bwd_data, 0, din);
    nn_call_set(&im->bwd_data, 1, im->w_bwd);
    nn_call_set(&im->bwd_data, 2, dout);
    nn_call_set(&im->bwd_data, 3, c->plan->scratch);
    nn_call_run(&im->bwd_data);
}
