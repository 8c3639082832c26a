/* MobileNetV3 (Howard et al. 2019) from a table of rows: inverted residual
 * blocks, norms folded into the weights for inference. */
#include "lib/net/mobilenet.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/nn/depthwise.h"
#include "lib/nn/squeeze_excite.h"

#define BLOCKS 18

/* One block as the table describes it; stage 255 ends the table.  expand 0 is
 * a depthwise-separable block, kernel 0 the last 1x1. */
struct mobilenet_row {
    unsigned char stage, kernel, stride;
    bool hs, se;                  /* hardswish instead of ReLU */
    unsigned short expand, out;
};

static const struct mobilenet_row small_100[] = {
    { 0, 3, 2, false, true, 0, 16 },
    { 1, 3, 2, false, false, 72, 24 }, { 1, 3, 1, false, false, 88, 24 },
    { 2, 5, 2, true, true, 96, 40 }, { 2, 5, 1, true, true, 240, 40 },
    { 2, 5, 1, true, true, 240, 40 },
    { 3, 5, 1, true, true, 120, 48 }, { 3, 5, 1, true, true, 144, 48 },
    { 4, 5, 2, true, true, 288, 96 }, { 4, 5, 1, true, true, 576, 96 },
    { 4, 5, 1, true, true, 576, 96 },
    { 5, 0, 1, true, false, 0, 576 }, { .stage = 255 }
};

static const struct mobilenet_row small_minimal[] = {
    { 0, 3, 2, false, false, 0, 16 },
    { 1, 3, 2, false, false, 72, 24 }, { 1, 3, 1, false, false, 88, 24 },
    { 2, 3, 2, false, false, 96, 40 }, { 2, 3, 1, false, false, 240, 40 },
    { 2, 3, 1, false, false, 240, 40 },
    { 3, 3, 1, false, false, 120, 48 }, { 3, 3, 1, false, false, 144, 48 },
    { 4, 3, 2, false, false, 288, 96 }, { 4, 3, 1, false, false, 576, 96 },
    { 4, 3, 1, false, false, 576, 96 },
    { 5, 0, 1, false, false, 0, 576 }, { .stage = 255 }
};

static const struct mobilenet_row large_minimal[] = {
    { 0, 3, 1, false, false, 0, 16 },
    { 1, 3, 2, false, false, 64, 24 }, { 1, 3, 1, false, false, 72, 24 },
    { 2, 3, 2, false, false, 72, 40 }, { 2, 3, 1, false, false, 120, 40 },
    { 2, 3, 1, false, false, 120, 40 },
    { 3, 3, 2, false, false, 240, 80 }, { 3, 3, 1, false, false, 200, 80 },
    { 3, 3, 1, false, false, 184, 80 }, { 3, 3, 1, false, false, 184, 80 },
    { 4, 3, 1, false, false, 480, 112 }, { 4, 3, 1, false, false, 672, 112 },
    { 5, 3, 2, false, false, 672, 160 }, { 5, 3, 1, false, false, 960, 160 },
    { 5, 3, 1, false, false, 960, 160 },
    { 6, 0, 1, false, false, 0, 960 }, { .stage = 255 }
};

static const struct mobilenet_variant {
    const char *name;
    const struct mobilenet_row *rows;
    double width;                 /* multiplies the table's channels */
    bool stem_hs, same;           /* SAME padding, eps 1e-3: the tf ones */
    signed char stage[5];         /* after which stage golden 01 looks */
} variants[] = {
    { "mobilenetv3_small_100", small_100, 1, true, false,
      { -1, 0, 1, 3, 5 } },
    { "mobilenetv3_small_150", small_100, 1.5, true, false,
      { -1, 0, 1, 3, 5 } },
    { "tf_mobilenetv3_small_minimal_100", small_minimal, 1, false, true,
      { -1, 0, 1, 3, 5 } },
    { "tf_mobilenetv3_large_minimal_100", large_minimal, 1, false, true,
      { 0, 1, 2, 4, 6 } },
};

/* A convolution, its batch norm, its activation. */
struct mobilenet_unit {
    bool depthwise;
    struct conv conv;
    struct depthwise dw;
    struct batch_norm bn;
    enum nn_act act;
    size_t C, h, w;               /* of the output */
    float *z, *y;                 /* before and after norm and activation */
};

struct mobilenet_block {
    bool expand, se, residual, last;
    unsigned char stage;
    struct mobilenet_unit up, dw, down;
    struct squeeze_excite squeeze;
    float *gated;                 /* the squeeze's output */
    const float *in;
};

struct mobilenet_impl {
    const struct mobilenet_variant *v;
    struct nn_plan plan;
    struct mobilenet_unit stem;
    struct mobilenet_block block[BLOCKS];
    size_t blocks;
    const float *rgb;
    float *mean_part;
    float *grad[3];               /* gradients on their way */
};

/* ---- declaring ----------------------------------------------------------- */

/* Tensors under `at`: a convolution named conv, its norm named bn. */
static void mobilenet_unit_init(struct mobilenet_unit *u,
                                struct mobilenet_impl *im, struct params *ps,
                                const char *at, const char *conv,
                                const char *bn, size_t in, size_t out,
                                size_t kernel, size_t stride, enum nn_act act,
                                bool depthwise)
{
    char name[120];
    enum conv_pad pad = im->v->same ? CONV_SAME : CONV_HALF;

    u->depthwise = depthwise;
    u->C = out;
    u->act = act;
    nn_name(name, "%s%s", at, conv);
    if (depthwise) {
        depthwise_init(&u->dw, ps, name, out, kernel, stride);
        u->dw.pad = pad;
    } else {
        conv_init(&u->conv, ps, name, in, out, kernel, stride, false);
        u->conv.pad = pad;
    }
    nn_name(name, "%s%s", at, bn);
    batch_norm_init(&u->bn, ps, name, out, im->v->same ? 1e-3f : NORM_EPS);
    u->bn.act = act;
}

/* The multiple of 8 next to C, never less than nine tenths of it. */
static size_t mobilenet_channels(double C)
{
    size_t n = (size_t)(C + 4) / 8 * 8;

    n = n < 8 ? 8 : n;
    return (double)n < 0.9 * C ? n + 8 : n;
}

/* base: the table's channels before this row; in: this network's. */
static void mobilenet_block_init(struct mobilenet_block *b,
                                 struct mobilenet_impl *im, struct params *ps,
                                 const char *at, const struct mobilenet_row *r,
                                 size_t base, size_t in)
{
    char name[120];
    enum nn_act act = r->hs ? ACT_HARDSWISH : ACT_RELU;
    size_t out = mobilenet_channels(r->out * im->v->width);
    size_t mid = r->expand ? mobilenet_channels((double)(in * r->expand) /
                                                (double)base)
                           : in;

    b->stage = r->stage;
    b->expand = r->expand;
    b->se = r->se;
    b->last = r->kernel == 0;
    b->residual = !b->last && r->stride == 1 && in == out;
    if (b->last) {
        mobilenet_unit_init(&b->down, im, ps, at, "conv", "bn1", in, out, 1, 1,
                            act, false);
        return;
    }
    if (b->expand)
        mobilenet_unit_init(&b->up, im, ps, at, "conv_pw", "bn1", in, mid, 1,
                            1, act, false);
    mobilenet_unit_init(&b->dw, im, ps, at, "conv_dw",
                        b->expand ? "bn2" : "bn1", mid, mid, r->kernel,
                        r->stride, act, true);
    if (b->se)
        squeeze_excite_init(&b->squeeze, ps, nn_name(name, "%sse", at), mid,
                            mobilenet_channels((double)(mid / 4)));
    mobilenet_unit_init(&b->down, im, ps, at,
                        b->expand ? "conv_pwl" : "conv_pw",
                        b->expand ? "bn3" : "bn2", mid, out, 1, 1, ACT_NONE,
                        false);
}

int mobilenet_init(struct mobilenet *m, struct params *ps, const char *prefix,
                   const char *variant, struct error *err)
{
    char at[120];
    const struct mobilenet_variant *v = NULL;

    memset(m, 0, sizeof *m);
    for (size_t i = 0; i < sizeof variants / sizeof *variants; i++)
        if (!strcmp(variants[i].name, variant))
            v = &variants[i];
    if (!v)
        return error_set(err, EX_CONFIG, "unknown network '%s' (expected "
                         "mobilenetv3_small_100, mobilenetv3_small_150, "
                         "tf_mobilenetv3_small_minimal_100 or "
                         "tf_mobilenetv3_large_minimal_100)",
                         variant);
    struct mobilenet_impl *im = calloc(1, sizeof *im);
    if (!im)
        return error_set(err, EX_OSERR, "out of memory");
    m->impl = im;
    im->v = v;
    size_t base = 16, in = mobilenet_channels(base * v->width), index = 0;
    mobilenet_unit_init(&im->stem, im, ps, prefix, "conv_stem", "bn1", 3, in,
                        3, 2, v->stem_hs ? ACT_HARDSWISH : ACT_RELU, false);
    for (const struct mobilenet_row *r = v->rows; r->stage != 255; r++) {
        index = r > v->rows && r->stage == r[-1].stage ? index + 1 : 0;
        nn_name(at, "%sblocks.%d.%zu.", prefix, r->stage, index);
        struct mobilenet_block *b = &im->block[im->blocks++];
        mobilenet_block_init(b, im, ps, at, r, base, in);
        base = r->out;
        in = b->down.C;
    }
    m->features = in;
    return 0;
}

int mobilenet_copy(struct mobilenet *m, const struct mobilenet *of,
                   struct error *err)
{
    *m = *of;
    m->impl = malloc(sizeof *m->impl);
    if (!m->impl)
        return error_set(err, EX_OSERR, "out of memory");
    *m->impl = *of->impl;
    return 0;
}

void mobilenet_release(struct mobilenet *m)
{
    struct mobilenet_impl *im = m->impl;

    if (!im)
        return;
    nn_plan_release(&im->plan);
    free(im);
    memset(m, 0, sizeof *m);
}

/* ---- planning ------------------------------------------------------------ */

/* One unit; add: the block's input is added to what it gives. */
static void mobilenet_unit_plan(struct mobilenet_unit *u, struct nn_plan *p,
                                size_t batch, size_t h, size_t w, bool add)
{
    bool train = nn_plan_backward(p);

    if (u->depthwise) {
        u->dw.act = train ? ACT_NONE : u->act;
        u->dw.norm = train ? NULL : &u->bn;
        depthwise_plan(&u->dw, p, batch, h, w);
        u->h = u->dw.oh;
        u->w = u->dw.ow;
    } else {
        u->conv.act = train ? ACT_NONE : u->act;
        u->conv.add = !train && add;
        u->conv.norm = train ? NULL : &u->bn;
        conv_plan(&u->conv, p, batch, h, w);
        u->h = u->conv.oh;
        u->w = u->conv.ow;
    }
    size_t rows = batch * u->h * u->w;
    if (train) {
        batch_norm_plan(&u->bn, p, rows);
        u->z = nn_plan_map(p, rows * u->C);
    }
    if (!train && add)
        return;                   /* added to the block's input in place */
    u->y = nn_plan_map(p, rows * u->C);
}

/* Returns the largest map of the block, in floats. */
static size_t mobilenet_block_plan(struct mobilenet_block *b,
                                   struct nn_plan *p, size_t batch, size_t *h,
                                   size_t *w, float **x)
{
    size_t max = 0, n;
    float *in = *x;

    b->in = in;
    if (b->last) {
        mobilenet_unit_plan(&b->down, p, batch, *h, *w, false);
        *x = b->down.y;
        return batch * *h * *w * b->down.C;
    }
    if (b->expand) {
        mobilenet_unit_plan(&b->up, p, batch, *h, *w, false);
        max = batch * *h * *w * b->up.C;
    }
    mobilenet_unit_plan(&b->dw, p, batch, *h, *w, false);
    if (b->expand)
        nn_plan_recycle(p, b->up.y);
    *h = b->dw.h;
    *w = b->dw.w;
    n = batch * *h * *w * b->dw.C;
    max = n > max ? n : max;
    b->gated = b->dw.y;
    if (b->se) {
        squeeze_excite_plan(&b->squeeze, p, batch, *h * *w);
        if (nn_plan_backward(p))
            b->gated = nn_plan_map(p, n);
    }
    mobilenet_unit_plan(&b->down, p, batch, *h, *w, b->residual);
    nn_plan_recycle(p, b->dw.y);
    if (!nn_plan_backward(p) && b->residual)
        b->down.y = in;
    else
        nn_plan_recycle(p, in);
    *x = b->down.y;
    return max;
}

int mobilenet_plan(struct mobilenet *m, size_t batch, size_t height,
                   size_t width, struct nn_options opt, struct error *err)
{
    struct mobilenet_impl *im = m->impl;
    struct nn_plan *p = &im->plan;

    nn_plan_release(p);
    nn_plan_init(p, opt);
    m->batch = batch;
    m->height = height;
    m->width = width;
    mobilenet_unit_plan(&im->stem, p, batch, height, width, false);
    size_t h = im->stem.h, w = im->stem.w, max = batch * h * w * im->stem.C;
    float *x = im->stem.y;
    for (size_t i = 0; i < im->blocks; i++) {
        size_t n = mobilenet_block_plan(&im->block[i], p, batch, &h, &w, &x);

        max = n > max ? n : max;
    }
    m->out_h = h;
    m->out_w = w;
    im->mean_part = nn_plan_floats(p, batch * NN_PARTS * m->features);
    if (nn_plan_backward(p))
        for (size_t i = 0; i < 3; i++)
            im->grad[i] = nn_plan_floats(p, max);
    return nn_plan_finish(p, err);
}

/* ---- one pass ------------------------------------------------------------ */

/* Returns the unit's output; res (or NULL) is added to it. */
static float *mobilenet_unit_forward(struct mobilenet_unit *u, const float *x,
                                     const float *res, bool train)
{
    float *z = train ? u->z : u->y;

    if (u->depthwise)
        depthwise_forward(z, x, &u->dw);
    else
        conv_forward(z, x, &u->conv);
    if (train)
        batch_norm_forward(u->y, z, res, &u->bn);
    return u->y;
}

/* Expansion, depthwise, squeeze and excite, projection; returns the output. */
static const float *mobilenet_block_forward(struct mobilenet_block *b,
                                            const float *x, bool train)
{
    const float *in = x;

    b->in = x;
    if (b->last)
        return mobilenet_unit_forward(&b->down, x, NULL, train);
    if (b->expand)
        x = mobilenet_unit_forward(&b->up, x, NULL, train);
    x = mobilenet_unit_forward(&b->dw, x, NULL, train);
    if (b->se) {
        squeeze_excite_forward(b->gated, x, &b->squeeze);
        x = b->gated;
    }
    return mobilenet_unit_forward(&b->down, x, b->residual ? in : NULL, train);
}

void mobilenet_forward(float *pooled, const float *rgb, struct mobilenet *m)
{
    struct mobilenet_impl *im = m->impl;
    bool train = nn_plan_backward(&im->plan);

    im->rgb = rgb;
    const float *x = mobilenet_unit_forward(&im->stem, rgb, NULL, train);
    for (size_t i = 0; i < im->blocks; i++)
        x = mobilenet_block_forward(&im->block[i], x, train);
    spatial_mean_forward(pooled, im->mean_part, x, m->batch,
                         m->out_h * m->out_w, m->features);
}

/* dy is overwritten; dx (or NULL) is written. */
static void mobilenet_unit_backward(float *dx, float *dy, const float *x,
                                    struct mobilenet_unit *u)
{
    batch_norm_backward(dy, dy, u->z, &u->bn);
    if (u->depthwise)
        depthwise_backward(dx, dy, x, &u->dw);
    else
        conv_backward(dx, dy, u->z, x, &u->conv);
}

/* g[0] holds the gradient of the block's output; on return, of its input.
 * The three buffers change places. */
static void mobilenet_block_backward(float *g[3], struct mobilenet_block *b)
{
    float *dy = g[0], *s = g[1], *t = g[2];
    size_t n = b->down.C * b->down.h * b->down.w;

    if (b->last) {
        mobilenet_unit_backward(s, dy, b->in, &b->down);
        g[0] = s;
        g[1] = dy;
        return;
    }
    if (b->residual) {            /* dy is needed again at the end */
        n *= b->down.bn.rows / (b->down.h * b->down.w);
        memcpy(t, dy, n * sizeof *t);
        mobilenet_unit_backward(s, t, b->gated, &b->down);
    } else {
        mobilenet_unit_backward(s, dy, b->gated, &b->down);
    }
    if (b->se)
        squeeze_excite_backward(s, s, b->dw.y, &b->squeeze);
    if (b->expand) {
        mobilenet_unit_backward(t, s, b->up.y, &b->dw);
        mobilenet_unit_backward(s, t, b->in, &b->up);
    } else {
        mobilenet_unit_backward(t, s, b->in, &b->dw);
        float *swap = s;
        s = t;
        t = swap;
    }
    if (b->residual)
        for (size_t i = 0; i < n; i++)
            s[i] += dy[i];
    g[0] = s;
    g[1] = t;
    g[2] = dy;
}

/* im->grad[0] holds the gradient of the last stage's map. */
static void mobilenet_blocks_backward(float *drgb, struct mobilenet *m)
{
    struct mobilenet_impl *im = m->impl;

    for (size_t i = im->blocks; i-- > 0;)
        mobilenet_block_backward(im->grad, &im->block[i]);
    mobilenet_unit_backward(drgb, im->grad[0], im->rgb, &im->stem);
}

void mobilenet_backward(float *drgb, const float *dpooled,
                        struct mobilenet *m)
{
    spatial_mean_backward(m->impl->grad[0], dpooled, m->batch,
                          m->out_h * m->out_w, m->features);
    mobilenet_blocks_backward(drgb, m);
}

void mobilenet_backward_features(float *drgb, const float *dfeatures,
                                 struct mobilenet *m)
{
    memcpy(m->impl->grad[0], dfeatures, m->batch * m->out_h * m->out_w *
           m->features * sizeof *dfeatures);
    mobilenet_blocks_backward(drgb, m);
}

const float *mobilenet_stage(size_t shape[4], const struct mobilenet *m,
                             int stage)
{
    const struct mobilenet_impl *im = m->impl;
    const struct mobilenet_unit *u = &im->stem;

    for (size_t i = 0; i < im->blocks; i++)
        if (im->block[i].stage <= im->v->stage[stage])
            u = &im->block[i].down;
    shape[0] = m->batch;
    shape[1] = u->h;
    shape[2] = u->w;
    shape[3] = u->C;
    return u->y;
}

/* ---- as a graph ---------------------------------------------------------- */

static int mobilenet_unit_graph(struct graph *g, int x,
                                const struct mobilenet_unit *u)
{
    struct conv plain = u->conv;

    plain.act = ACT_NONE;         /* a plan may have moved the norm's there */
    x = u->depthwise ? graph_depthwise(g, x, &u->dw)
                     : graph_conv(g, x, &plain);
    return graph_batch_norm(g, x, &u->bn);
}

static int mobilenet_block_graph(struct graph *g, int in,
                                 const struct mobilenet_block *b)
{
    int x = in;

    if (b->last)
        return mobilenet_unit_graph(g, x, &b->down);
    if (b->expand)
        x = mobilenet_unit_graph(g, x, &b->up);
    x = mobilenet_unit_graph(g, x, &b->dw);
    if (b->se)
        x = graph_squeeze_excite(g, x, &b->squeeze);
    x = mobilenet_unit_graph(g, x, &b->down);
    return b->residual ? GRAPH_NODE(g, "Add", x, in) : x;
}

int mobilenet_graph(struct graph *g, int maps, const struct mobilenet *m)
{
    const struct mobilenet_impl *im = m->impl;
    int x = mobilenet_unit_graph(g, maps, &im->stem);

    for (size_t i = 0; i < im->blocks; i++)
        x = mobilenet_block_graph(g, x, &im->block[i]);
    return graph_mean(g, x);
}
