/* Phi_D (Section 3.2): a shared trunk over the points, then a small head for
 * each attribute. */
#include "lib/net/mlp_decoder.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"
#include "lib/net/harmonic.h"
#include "lib/nn/conv.h"
#include "lib/nn/image.h"

#define ATTRIBUTES 4

static const char *const attribute[ATTRIBUTES] = { "color", "opacity", "scale",
                                                   "rotation" };

struct mlp_decoder_impl {
    struct nn_plan plan;
    struct conv trunk[4], inner[ATTRIBUTES], outer[ATTRIBUTES];
    int heads;                   /* of inner and outer: 4, or colours' alone */
    size_t padded;               /* width + gamma, a multiple of 16 */
    const float *features;
    float *gamma, *dgamma;       /* (B,27) */
    float *y[4];                 /* (B,N,width) */
    float *x;                    /* (B,N,padded) */
    float *h[ATTRIBUTES];        /* (B,N,hidden) */
    float *o[ATTRIBUTES];        /* (B,N,attribute) */
    float *raw, *draw;           /* (B,N,width of the head) */
    float *grad[2];
    float *dx, *dsum;
};

/* Numbers of attribute i. */
static size_t mlp_decoder_width(const struct mlp_decoder *d, int i)
{
    return i == 0 ? d->head.colors : i == 1 ? 1 : i == 2 ? 3 : 4;
}

int mlp_decoder_init(struct mlp_decoder *d, struct params *ps,
                     const char *prefix, size_t in, size_t width,
                     size_t hidden, struct gaussian_head head,
                     struct error *err)
{
    char name[120];

    memset(d, 0, sizeof *d);
    d->impl = calloc(1, sizeof *d->impl);
    if (!d->impl)
        return error_set(err, EX_OSERR, "out of memory");
    struct mlp_decoder_impl *im = d->impl;
    d->head = head;
    d->in = in;
    d->width = width;
    d->hidden = hidden;
    im->heads = head.colors_only ? 1 : ATTRIBUTES;
    for (int i = 0; i < 4; i++) {
        nn_name(name, "%sfeature_layers.%d", prefix, 2 * i);
        linear_init(&im->trunk[i], ps, name, i ? width : in, width);
        im->trunk[i].act = i < 3 ? ACT_RELU : ACT_NONE;
        ps->tensor[im->trunk[i].weight].gain = i < 3 ? 1.4142135f : 1;
    }
    for (int i = 0; i < im->heads; i++) {
        nn_name(name, "%s%s_layers.0", prefix, attribute[i]);
        linear_init(&im->inner[i], ps, name, width + HARMONIC_OUT, hidden);
        im->inner[i].act = ACT_RELU;
        ps->tensor[im->inner[i].weight].gain = 1.4142135f;
        nn_name(name, "%s%s_layers.2", prefix, attribute[i]);
        linear_init(&im->outer[i], ps, name, hidden, mlp_decoder_width(d, i));
        ps->tensor[im->outer[i].weight].gain = 0.3f;
    }
    return 0;
}

/* What the backward needs besides the activations. */
static void mlp_decoder_plan_gradients(struct mlp_decoder *d, size_t rows)
{
    struct mlp_decoder_impl *im = d->impl;
    struct nn_plan *p = &im->plan;
    size_t max = d->width > d->hidden ? d->width : d->hidden;

    max = max > d->head.colors ? max : d->head.colors;
    im->grad[0] = nn_plan_floats(p, rows * max);
    im->grad[1] = nn_plan_floats(p, rows * max);
    im->dx = nn_plan_floats(p, rows * im->padded);
    im->dsum = nn_plan_floats(p, rows * im->padded);
    im->draw = nn_plan_floats(p, rows * gaussian_head_width(&d->head));
    im->dgamma = nn_plan_floats(p, d->batch * HARMONIC_OUT);
}

/* The heads, one after another. */
static void mlp_decoder_plan_heads(struct mlp_decoder *d, size_t rows)
{
    struct mlp_decoder_impl *im = d->impl;
    struct nn_plan *p = &im->plan;

    im->x = nn_plan_map(p, rows * im->padded);
    for (int i = 0; i < im->heads; i++) {
        im->inner[i].in_data = im->padded;
        im->h[i] = nn_plan_map(p, rows * d->hidden);
        linear_plan(&im->inner[i], p, rows);
        im->o[i] = nn_plan_map(p, rows * mlp_decoder_width(d, i));
        linear_plan(&im->outer[i], p, rows);
        nn_plan_recycle(p, im->h[i]);
    }
}

int mlp_decoder_plan(struct mlp_decoder *d, size_t batch, size_t points,
                     struct nn_options opt, struct error *err)
{
    struct mlp_decoder_impl *im = d->impl;
    struct nn_plan *p = &im->plan;
    size_t rows = batch * points;

    nn_plan_release(p);
    nn_plan_init(p, opt);
    d->batch = batch;
    d->points = points;
    im->padded = (d->width + HARMONIC_OUT + 15) / 16 * 16;
    im->gamma = nn_plan_floats(p, batch * HARMONIC_OUT);
    im->raw = nn_plan_map(p, rows * gaussian_head_width(&d->head));
    for (int i = 0; i < 4; i++) {
        im->y[i] = nn_plan_map(p, rows * d->width);
        linear_plan(&im->trunk[i], p, rows);
        if (i)
            nn_plan_recycle(p, im->y[i - 1]);
    }
    mlp_decoder_plan_heads(d, rows);
    if (nn_plan_backward(p))
        mlp_decoder_plan_gradients(d, rows);
    return nn_plan_finish(p, err);
}

void mlp_decoder_release(struct mlp_decoder *d)
{
    if (!d->impl)
        return;
    nn_plan_release(&d->impl->plan);
    free(d->impl);
    memset(d, 0, sizeof *d);
}

/* One row. */
PARALLEL(mlp_decoder_gather_part, r, struct mlp_decoder_impl *, im,
         _Bool, back, int, i, size_t, n, size_t, row, size_t, at)
{
    if (back)
        memcpy(im->o[i] + r * n, im->draw + r * row + at, n * sizeof(float));
    else
        memcpy(im->raw + r * row + at, im->o[i] + r * n, n * sizeof(float));
}

/* raw (rows,width of the head) <-> the attributes' own arrays. */
static void mlp_decoder_gather(struct mlp_decoder *d, bool back)
{
    struct mlp_decoder_impl *im = d->impl;
    size_t rows = d->batch * d->points, at = 0;
    const size_t row = gaussian_head_width(&d->head);

    for (int i = 0; i < im->heads; i++) {
        size_t n = mlp_decoder_width(d, i);

        parallel_each(mlp_decoder_gather_part, rows, 1, im, back, i, n, row, at);
        at += n;
    }
}

/* raw from y[3] and gamma. */
static void mlp_decoder_heads(struct mlp_decoder *d)
{
    struct mlp_decoder_impl *im = d->impl;

    concat_forward(im->x, im->y[3], im->gamma, d->batch * d->points, d->width,
                   HARMONIC_OUT, im->padded, d->points);
    for (int i = 0; i < im->heads; i++) {
        conv_forward(im->h[i], im->x, &im->inner[i]);
        conv_forward(im->o[i], im->h[i], &im->outer[i]);
    }
    mlp_decoder_gather(d, false);
}

/* Reverse of mlp_decoder_heads: dy (B,N,width) from draw; b is scratch. */
static void mlp_decoder_heads_backward(float *dy, float *b, bool dir,
                                       struct mlp_decoder *d)
{
    struct mlp_decoder_impl *im = d->impl;
    size_t rows = d->batch * d->points;

    mlp_decoder_gather(d, true);              /* o[i] holds its gradient now */
    for (int i = 0; i < im->heads; i++) {
        conv_backward(b, im->o[i], im->o[i], im->h[i], &im->outer[i]);
        conv_backward(i ? im->dx : im->dsum, b, im->h[i], im->x,
                      &im->inner[i]);
        if (i)
            image_add(im->dsum, im->dx, rows * im->padded);
    }
    concat_backward(dy, dir ? im->dgamma : NULL, im->dsum, rows, d->width,
                    HARMONIC_OUT, im->padded, d->points);
}

void mlp_decoder_forward(struct gaussian_out *out, const float *features,
                         const float *dir, const float *rgb_logit,
                         struct mlp_decoder *d)
{
    struct mlp_decoder_impl *im = d->impl;

    im->features = features;
    conv_forward(im->y[0], features, &im->trunk[0]);
    for (int i = 1; i < 4; i++)
        conv_forward(im->y[i], im->y[i - 1], &im->trunk[i]);
    harmonic_forward(im->gamma, dir, d->batch);
    mlp_decoder_heads(d);
    gaussian_head_forward(out, im->raw, rgb_logit, &d->head, d->batch,
                          d->points, gaussian_head_width(&d->head), d->points);
}

void mlp_decoder_backward(float *dfeatures, float *ddir,
                          const struct gaussian_out *dout, const float *dir,
                          const float *rgb_logit, struct mlp_decoder *d)
{
    struct mlp_decoder_impl *im = d->impl;
    float *a = im->grad[0], *b = im->grad[1];

    gaussian_head_backward(im->draw, NULL, dout, im->raw, rgb_logit,
                           &d->head, d->batch, d->points,
                           gaussian_head_width(&d->head), d->points);
    memset(im->dgamma, 0, d->batch * HARMONIC_OUT * sizeof *im->dgamma);
    mlp_decoder_heads_backward(a, b, ddir != NULL, d);
    if (ddir) {
        memset(ddir, 0, 3 * d->batch * sizeof *ddir);
        harmonic_backward(ddir, im->dgamma, dir, d->batch);
    }
    for (int i = 3; i > 0; i--) {
        conv_backward(b, a, im->y[i], im->y[i - 1], &im->trunk[i]);
        float *swap = a;
        a = b;
        b = swap;
    }
    conv_backward(dfeatures, a, im->y[0], im->features, &im->trunk[0]);
}

/* ---- as a graph ---------------------------------------------------------- */

void mlp_decoder_graph(struct graph *g, size_t N,
                       const struct mlp_decoder *d)
{
    const struct mlp_decoder_impl *im = d->impl;
    int x = GRAPH_INPUT(g, "features", N, d->in), part[ATTRIBUTES];
    int gamma = harmonic_graph(g, GRAPH_INPUT(g, "direction", 1, 3));
    int logit = GRAPH_INPUT(g, "rgb_logit", N, 3);

    for (int i = 0; i < 4; i++)
        x = graph_linear(g, x, &im->trunk[i]);
    gamma = GRAPH_NODE(g, "Expand", gamma,
                       GRAPH_INTS(g, (int64_t)N, HARMONIC_OUT));
    x = graph_concat(g, x, gamma);
    for (int i = 0; i < im->heads; i++)
        part[i] = graph_linear(g, graph_linear(g, x, &im->inner[i]),
                               &im->outer[i]);
    int raw = graph_node(g, "Concat", part, (size_t)im->heads);
    graph_set_int(g, "axis", 1);
    gaussian_head_graph(g, raw, logit, N, &d->head);
}
