/* Convolutions by oneDNN's direct method: the description of the work, its
 * primitives, and running them.  Activations are NHWC as everywhere; weights
 * are reordered to the layout that a primitive asks for.  The weights' gradient
 * is made from a fixed number of parts, each on one thread, so that it is the
 * same bits for any number of threads. */
#include <assert.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"
#include "lib/nn/conv_impl.h"
#include "lib/nn/image.h"

/* ---- describing the work ----------------------------------------------- */

struct conv_onednn_mds {
    dnnl_memory_desc_t src, wei, bia, dst;
    dnnl_dims_t stride, pad0, pad1;
};

/* The tensors of a forward pass, and its geometry. */
static void conv_onednn_describe(struct conv_onednn_mds *m,
                                 const struct conv *c,
                                 const struct conv_shape *s)
{
    dnnl_dims_t src = { s->n, c->in_data, s->h, s->w };
    dnnl_dims_t wei = { c->out, c->in_data, c->kernel, c->kernel };
    dnnl_dims_t dst = { s->n, c->out, s->oh, s->ow };
    dnnl_dims_t bia = { c->out };

    memset(m, 0, sizeof *m);
    dnnl_memory_desc_init_by_tag(&m->src, 4, src, c->impl->input, dnnl_nhwc);
    dnnl_memory_desc_init_by_tag(&m->wei, 4, wei, c->impl->weights,
                                 dnnl_format_tag_any);
    dnnl_memory_desc_init_by_tag(&m->bia, 1, bia, dnnl_f32, dnnl_a);
    dnnl_memory_desc_init_by_tag(&m->dst, 4, dst,
                                 c->half_out ? dnnl_bf16 : dnnl_f32,
                                 dnnl_nhwc);
    m->stride[0] = m->stride[1] = c->stride;
    m->pad0[0] = s->top;
    m->pad0[1] = s->left;
    m->pad1[0] = s->bottom;
    m->pad1[1] = s->right;
}

/* (1,out,1,1): what multiplies each channel's sum of 8-bit products. */
static void conv_onednn_describe_scale(dnnl_memory_desc_t *md,
                                       const struct conv *c)
{
    dnnl_dims_t dims = { 1, c->out, 1, 1 };

    dnnl_memory_desc_init_by_tag(md, 4, dims, dnnl_f32, dnnl_nchw);
}

/* What follows the sums of a forward: scale, addition, activation. */
static dnnl_primitive_attr_t conv_onednn_attributes(const struct conv *c,
                                                    bool forward)
{
    static const dnnl_alg_kind_t alg[] = {
        [ACT_RELU] = dnnl_eltwise_relu, [ACT_LRELU] = dnnl_eltwise_relu,
        [ACT_HARDSWISH] = dnnl_eltwise_hardswish,
        [ACT_SIGMOID] = dnnl_eltwise_logistic, [ACT_TANH] = dnnl_eltwise_tanh,
        [ACT_GELU] = dnnl_eltwise_gelu_erf,
        [ACT_GELU_TANH] = dnnl_eltwise_gelu_tanh,
        [ACT_SILU] = dnnl_eltwise_swish
    };
    dnnl_primitive_attr_t attr;
    dnnl_post_ops_t post;

    dnnl_primitive_attr_create(&attr);
    dnnl_primitive_attr_set_scratchpad_mode(attr, dnnl_scratchpad_mode_user);
    if (!forward)
        return attr;
    dnnl_post_ops_create(&post);
    if (c->impl->input == dnnl_u8) {
        dnnl_memory_desc_t scale;
        conv_onednn_describe_scale(&scale, c);
        dnnl_post_ops_append_binary(post, dnnl_binary_mul, &scale);
    }
    if (c->add)
        dnnl_post_ops_append_sum(post, 1);
    if (c->act != ACT_NONE)
        dnnl_post_ops_append_eltwise(post, 1, alg[c->act],
                                     c->act == ACT_LRELU ? ACT_SLOPE
                                     : c->act == ACT_SILU ? 1 : 0, 0);
    dnnl_primitive_attr_set_post_ops(attr, post);
    dnnl_post_ops_destroy(post);
    return attr;
}

enum conv_onednn_pass { FORWARD, BACKWARD_DATA, BACKWARD_WEIGHTS };

/* Whether a layer that learns multiplies bfloat16: then all that is read of
 * activations and gradients is, and what is written is float. */
static bool conv_onednn_half(const struct conv *c)
{
    return nn_plan_backward(c->plan) && c->impl->input == dnnl_bf16;
}

/* Whether a layer of halves computes its input's gradient in float: oneDNN
 * 2.6's is wrong in bfloat16 for 1x1 layers whose outputs fill no whole vector
 * and some numbers of pixels (300 and 600, 32 -> 41). */
static bool conv_onednn_full_data(const struct conv *c)
{
    return conv_onednn_half(c) && c->kernel == 1 && c->out % 16;
}

/* The types of a backward pass, which differ from its forward's. */
static void conv_onednn_describe_backward(struct conv_onednn_mds *m,
                                          const struct conv *c,
                                          enum conv_onednn_pass pass)
{
    if (!conv_onednn_half(c) ||
        (pass == BACKWARD_DATA && conv_onednn_full_data(c)))
        return;
    m->dst.data_type = dnnl_bf16;
    if (pass == BACKWARD_DATA)
        m->src.data_type = c->half_in ? dnnl_bf16 : dnnl_f32;
    else
        m->wei.data_type = dnnl_f32;
}

/* The implementation of a forward.  For floats and more than one tap oneDNN would
 * take one whose tens of kernels are no faster than the next one's few, but each
 * changes the protection of a page, for which all threads stop. */
static dnnl_status_t conv_onednn_choose(dnnl_primitive_desc_t *pd,
                                        const dnnl_convolution_desc_t *d,
                                        const_dnnl_primitive_attr_t attr,
                                        const struct conv *c)
{
    const bool few = c->impl->input == dnnl_f32 && c->kernel > 1;
    dnnl_primitive_desc_iterator_t it;
    const char *name = NULL;
    dnnl_status_t ok = dnnl_primitive_desc_iterator_create(&it, d, attr,
                                                           nn_engine(), NULL);

    if (ok)
        return ok;
    do {
        dnnl_primitive_desc_destroy(*pd);
        *pd = dnnl_primitive_desc_iterator_fetch(it);
        dnnl_primitive_desc_query(*pd, dnnl_query_impl_info_str, 0, &name);
    } while (few && !strncmp(name, "brgconv:", 8) &&
             !dnnl_primitive_desc_iterator_next(it));
    dnnl_primitive_desc_iterator_destroy(it);
    return dnnl_success;
}

/* The primitive descriptor of one pass; NULL after telling the plan. */
static dnnl_primitive_desc_t conv_onednn_primitive(const struct conv *c,
                                                   enum conv_onednn_pass pass,
                                                   const struct conv_shape *s)
{
    struct nn_plan *p = c->plan;
    struct conv_onednn_mds m;

    dnnl_convolution_desc_t d;
    dnnl_primitive_desc_t pd = NULL, hint = NULL;
    bool bwd = nn_plan_backward(p);

    conv_onednn_describe(&m, c, s);
    if (pass == BACKWARD_DATA && conv_onednn_full_data(c))
        m.src.data_type = m.wei.data_type = m.dst.data_type = dnnl_f32;
    dnnl_primitive_attr_t attr = conv_onednn_attributes(c, pass == FORWARD);
    dnnl_status_t ok = dnnl_convolution_forward_desc_init(
        &d, bwd ? dnnl_forward_training : dnnl_forward_inference,
        dnnl_convolution_direct, &m.src, &m.wei,
        pass == FORWARD ? &m.bia : NULL, &m.dst, m.stride, m.pad0, m.pad1);
    if (!ok)
        ok = conv_onednn_choose(&pd, &d, attr, c);
    if (!ok && pass != FORWARD) {
        hint = pd;
        pd = NULL;
        conv_onednn_describe_backward(&m, c, pass);
        ok = pass == BACKWARD_DATA
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
                     c->kernel, s->h, s->w, nn_type_name(nn_plan_type(p)));
        return NULL;
    }
    return pd;
}

/* The layout that pd wants an argument in. */
static const dnnl_memory_desc_t *conv_onednn_query(
    const_dnnl_primitive_desc_t pd, dnnl_query_t what)
{
    return dnnl_primitive_desc_query_md(pd, what, 0);
}

/* ---- planning ---------------------------------------------------------- */

/* A reorder of weights between the checkpoint's layout and oneDNN's md; back
 * adds to what is there. */
static void conv_onednn_plan_reorder(struct nn_call *call,
                                     const struct conv *c,
                                     const dnnl_memory_desc_t *md, bool back)
{
    struct nn_plan *p = c->plan;

    dnnl_memory_desc_t plain;
    dnnl_dims_t dims = { c->out, c->in_data, c->kernel, c->kernel };
    dnnl_primitive_desc_t pd = NULL;
    dnnl_primitive_attr_t attr;
    dnnl_post_ops_t post;

    dnnl_memory_desc_init_by_tag(&plain, 4, dims, c->impl->weights == dnnl_s8
                                 ? dnnl_s8 : dnnl_f32, dnnl_oihw);
    dnnl_primitive_attr_create(&attr);
    dnnl_primitive_attr_set_scratchpad_mode(attr, dnnl_scratchpad_mode_user);
    dnnl_post_ops_create(&post);
    if (back)
        dnnl_post_ops_append_sum(post, 1);
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

/* The arguments of one band's primitive. */
static void conv_onednn_plan_call(struct nn_call *call, struct conv *c,
                                  dnnl_primitive_desc_t pd, bool back,
                                  size_t *scratch)
{
    struct nn_plan *p = c->plan;
    size_t bytes;

    nn_call_init(call, pd, p);
    nn_call_arg(call, back ? DNNL_ARG_DIFF_SRC : DNNL_ARG_SRC,
                conv_onednn_query(pd, back ? dnnl_query_diff_src_md
                                           : dnnl_query_src_md), p);
    nn_call_arg(call, DNNL_ARG_WEIGHTS,
                conv_onednn_query(pd, dnnl_query_weights_md), p);
    nn_call_arg(call, back ? DNNL_ARG_DIFF_DST : DNNL_ARG_DST,
                conv_onednn_query(pd, back ? dnnl_query_diff_dst_md
                                           : dnnl_query_dst_md), p);
    bytes = (nn_call_scratch(call, pd, p) + 4095) & ~(size_t)4095;
    *scratch = bytes > *scratch ? bytes : *scratch;
    if (back)
        return;
    nn_call_arg(call, DNNL_ARG_BIAS,
                dnnl_primitive_desc_query_md(pd, dnnl_query_weights_md, 1), p);
    if (c->impl->input == dnnl_u8) {
        dnnl_memory_desc_t scale;
        conv_onednn_describe_scale(&scale, c);
        nn_call_arg(call, DNNL_ARG_ATTR_MULTIPLE_POST_OP(0) |
                    DNNL_ARG_SRC_1, &scale, p);
    }
}

/* All bands of a pass, and the layout of its weights; false when a band asks
 * for another layout than the first. */
static bool conv_onednn_plan_bands(struct conv_bands *b,
                                   dnnl_memory_desc_t *weights, struct conv *c,
                                   const struct conv_shape *s, size_t n,
                                   bool back)
{
    b->count = 0;
    for (size_t i = 0; i < n; i++) {
        struct conv_band *band = &b->band[i];
        const struct conv_shape cut = conv_band_cut(band, c, s, i, n, back);
        dnnl_primitive_desc_t pd = conv_onednn_primitive(
            c, back ? BACKWARD_DATA : FORWARD, &cut);

        if (!pd)
            return true;
        const dnnl_memory_desc_t *md =
            conv_onednn_query(pd, dnnl_query_weights_md);
        const bool same = i == 0 || dnnl_memory_desc_equal(md, weights);
        if (i == 0)
            *weights = *md;
        if (same)
            conv_onednn_plan_call(&band->call, c, pd, back, &b->scratch);
        dnnl_primitive_desc_destroy(pd);
        if (!same)
            return false;
    }
    b->count = n;
    return true;
}

/* Plan a pass in bands, and where its weights go: *w, by the reorder. */
static void conv_onednn_plan_pass(struct conv_bands *b, void **w,
                                  struct nn_call *reorder, struct conv *c,
                                  const struct conv_shape *s, bool back)
{
    dnnl_memory_desc_t weights = {0};
    size_t n = conv_band_count(c, s, back ? s->h / c->stride : s->oh);

    n = n > s->n ? n / s->n * s->n : n;
    if (!conv_onednn_plan_bands(b, &weights, c, s, n, back)) {
        for (size_t i = 0; i < CONV_BANDS; i++)
            nn_call_release(&b->band[i].call);
        conv_onednn_plan_bands(b, &weights, c, s, 1, back);
    }
    if (!b->count)
        return;
    *w = nn_plan_bytes(c->plan, dnnl_memory_desc_get_size(&weights));
    conv_onednn_plan_reorder(reorder, c, &weights, false);
}

void conv_onednn_plan_forward(struct conv *c, const struct conv_shape *s)
{
    struct conv_impl *im = c->impl;
    struct nn_plan *p = c->plan;
    size_t values = c->batch * c->h * c->w * c->in_data, scratch;

    conv_onednn_plan_pass(&im->fwd, &im->w_fwd, &im->to_fwd, c, s, false);
    im->half_at = scratch = im->fwd.count * im->fwd.scratch;
    if (im->input == dnnl_u8)
        scratch += int8_input_size(&im->int8, c);
    else if (im->input == dnnl_bf16)
        scratch += values * sizeof(uint16_t);
    nn_plan_scratch(p, scratch);
}

/* A backward's scratch: `bytes` of oneDNN's, then the input and the output's
 * gradient as bfloat16 where those are read, or the input's in float. */
static void conv_onednn_reserve(struct conv *c, size_t bytes)
{
    struct conv_impl *im = c->impl;
    size_t in = c->batch * c->h * c->w * c->in_data;
    size_t out = c->batch * c->oh * c->ow * c->out;

    bytes = (bytes + 4095) & ~(size_t)4095;
    if (bytes > im->back_at)
        im->back_at = bytes;
    if (conv_onednn_half(c))
        bytes = im->back_at + ((2 * in + out) * sizeof(uint16_t) + 128);
    nn_plan_scratch(c->plan, bytes);
}

void conv_onednn_plan_backward_data(struct conv *c,
                                    const struct conv_shape *s)
{
    struct conv_impl *im = c->impl;

    conv_onednn_plan_pass(&im->bwd_data, &im->w_bwd, &im->to_bwd, c, s, true);
    conv_onednn_reserve(c, im->bwd_data.count * im->bwd_data.scratch);
}

/* One part of the weights' gradient; the first also decides the layout. */
static void conv_onednn_plan_part(struct conv *c, struct conv_part *part,
                                  const struct conv_shape *s, bool first)
{
    struct conv_impl *im = c->impl;
    struct nn_plan *p = c->plan;

    dnnl_primitive_desc_t pd = conv_onednn_primitive(c, BACKWARD_WEIGHTS, s);

    if (!pd)
        return;
    const dnnl_memory_desc_t *md =
        conv_onednn_query(pd, dnnl_query_diff_weights_md);
    nn_call_init(&part->call, pd, p);
    nn_call_arg(&part->call, DNNL_ARG_SRC,
                conv_onednn_query(pd, dnnl_query_src_md), p);
    nn_call_arg(&part->call, DNNL_ARG_DIFF_DST,
                conv_onednn_query(pd, dnnl_query_diff_dst_md), p);
    nn_call_arg(&part->call, DNNL_ARG_DIFF_WEIGHTS, md, p);
    size_t bytes = nn_call_scratch(&part->call, pd, p);
    bytes = (bytes + 4095) & ~(size_t)4095;
    if (bytes > im->scratch)
        im->scratch = bytes;
    if (first) {
        im->dw_count = dnnl_memory_desc_get_size(md) / sizeof(float);
        conv_onednn_plan_reorder(&im->add_dw, c, md, true);
    } else if (dnnl_memory_desc_get_size(md) != im->dw_count * sizeof(float)) {
        nn_plan_fail(p, EX_SOFTWARE, "parts of a gradient differ in layout");
    }
    dnnl_primitive_desc_destroy(pd);
}

/* Split over images, or images' bands, and make every part a primitive for
 * one thread. */
void conv_onednn_plan_backward_weights(struct conv *c,
                                       const struct conv_shape *s)
{
    struct conv_impl *im = c->impl;
    size_t bands = s->n < NN_PARTS ? NN_PARTS / s->n : 1;

    if (s->oh < 4 * bands)
        bands = 1;
    im->parts = bands > 1 ? s->n * bands : s->n < NN_PARTS ? s->n : NN_PARTS;
    for (size_t i = 0; i < im->parts; i++) {
        struct conv_part *part = &im->part[i];
        struct conv_shape b = *s;
        size_t image = i * s->n / im->parts, first = 0, y0 = 0;

        if (bands > 1) {
            size_t k = i % bands;

            image = i / bands;
            y0 = k * s->oh / bands;
            b = conv_band_of_output(s, c, y0, (k + 1) * s->oh / bands, &first);
        } else {
            b.n = (i + 1) * s->n / im->parts - image;
        }
        part->in_at = (image * s->h + first) * s->w * c->in_data;
        part->out_at = (image * s->oh + y0) * s->ow * c->out;
        conv_onednn_plan_part(c, part, &b, i == 0);
    }
    for (size_t i = 0; i < im->parts; i++)
        im->part[i].dw = nn_plan_floats(c->plan, im->dw_count);
    conv_onednn_reserve(c, im->scratch * im->parts);
}

/* ---- running ----------------------------------------------------------- */

void conv_onednn_reorder(struct nn_call *call, void *to, const void *from,
                         struct conv *c)
{
    nn_call_set(call, 0, from);
    nn_call_set(call, 1, to);
    nn_call_set(call, 2, c->plan->scratch);
    nn_call_run(call);
}

/* Band i of a pass from `in` to `out` (of a backward, the other way round),
 * whose values are of that many bytes. */
PARALLEL(conv_onednn_band, i, struct conv_bands *, bands, const char *, in,
         const char *, out, size_t, in_size, size_t, out_size, const void *, w,
         const float *, bias, const float *, scale, char *, scratch)
{
    struct conv_band *b = &bands->band[i];

    nn_call_set(&b->call, 0, in + b->in_at * in_size);
    nn_call_set(&b->call, 1, w);
    nn_call_set(&b->call, 2, out + b->out_at * out_size);
    nn_call_set(&b->call, 3, scratch + i * bands->scratch);
    if (bias)
        nn_call_set(&b->call, 4, bias);
    if (scale)
        nn_call_set(&b->call, 5, scale);
    nn_call_run(&b->call);
}

void conv_onednn_forward(void *out, const void *src, const float *bias,
                         const float *scale, struct conv *c)
{
    struct conv_impl *im = c->impl;

    parallel_each(conv_onednn_band, im->fwd.count, 1, &im->fwd, src, out,
                  im->input == dnnl_u8 ? 1 : im->input == dnnl_bf16 ? 2 : 4,
                  c->half_out ? 2 : 4, im->w_fwd, bias, scale,
                  c->plan->scratch);
}

/* n values at place `at` of the backward's bfloat16 ones; or as they are, where
 * they lie as they are wanted. */
static const void *conv_onednn_narrow(const void *x, size_t n, size_t at,
                                      bool lie, const struct conv *c)
{
    uint16_t *half = (uint16_t *)(void *)(c->plan->scratch +
                                          c->impl->back_at) + at;

    if (lie || !conv_onednn_half(c))
        return x;
    image_to_bf16(half, x, n);
    return half;
}

/* Part of an array of floats or, in a layer of halves, of half as many
 * bytes. */
static const void *conv_onednn_at(const void *x, size_t at,
                                  const struct conv *c)
{
    return (const char *)x + at * (conv_onednn_half(c) ? sizeof(uint16_t)
                                                       : sizeof(float));
}

void conv_onednn_backward_data(void *din, const void *dout, struct conv *c)
{
    struct conv_bands *b = &c->impl->bwd_data;
    const bool full = conv_onednn_full_data(c);
    void *to = full && c->half_in ? c->plan->scratch + c->impl->back_at : din;
    const void *from = conv_onednn_narrow(dout, c->batch * c->oh * c->ow *
                                          c->out, 0, full || c->half_out, c);

    assert(b->count && !(full && c->half_out));
    parallel_each(conv_onednn_band, b->count, 1, b, to, from,
                  c->half_in && !full ? 2 : 4,
                  conv_onednn_half(c) && !full ? 2 : 4, c->impl->w_bwd, NULL,
                  NULL, c->plan->scratch);
    if (to != din)
        image_to_bf16(din, to, c->batch * c->h * c->w * c->in_data);
}

/* Part i of the weights' gradient from x and the output's gradient d. */
PARALLEL(conv_onednn_part, i, struct conv *, c, const void *, x,
         const void *, d)
{
    struct conv_part *part = &c->impl->part[i];

    nn_call_set(&part->call, 0, conv_onednn_at(x, part->in_at, c));
    nn_call_set(&part->call, 1, conv_onednn_at(d, part->out_at, c));
    nn_call_set(&part->call, 2, part->dw);
    nn_call_set(&part->call, 3, c->plan->scratch + i * c->impl->scratch);
    nn_call_run(&part->call);
}

const float *conv_onednn_backward_weights(const void *dout, const void *in,
                                          struct conv *c)
{
    struct conv_impl *im = c->impl;
    size_t out = c->batch * c->oh * c->ow * c->out;
    const void *d = conv_onednn_narrow(dout, out, 0, c->half_out, c);
    const void *x = conv_onednn_narrow(in, c->batch * c->h * c->w *
                                       c->in_data, (out + 31) & ~(size_t)31,
                                       c->half_in, c);

    parallel_each(conv_onednn_part, im->parts, 1, c, x, d);
    float *sum = im->part[0].dw;
    for (size_t i = 1; i < im->parts; i++)
        for (size_t k = 0; k < im->dw_count; k++)
            sum[k] += im->part[i].dw[k];
    return sum;
}
