/* Phi_D (Section 3.2): a shared trunk over the points, then a small head for
 * each attribute. */
#include "lib/net/mlp_decoder.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"
#include "lib/net/attribute_heads.h"
#include "lib/net/harmonic.h"
#include "lib/nn/conv.h"
#include "lib/nn/image.h"

static const char *const attribute[4] = { "color", "opacity", "scale",
                                          "rotation" };

struct mlp_decoder_impl {
    struct nn_plan plan;
    struct conv trunk[4], inner[ATTRIBUTE_HEADS], outer[ATTRIBUTE_HEADS];
    struct attribute_heads heads;   /* of inner and outer, where... */
    bool halves;                 /* ... it learns in bfloat16: y and grad are */
    int wanted;                  /* the first so many heads, by the last forward */
    size_t padded;               /* width + gamma, a multiple of 16 */
    const float *features;
    float *gamma, *dgamma;       /* (B,27) */
    void *y[4];                  /* (B,N,width) */
    float *x;                    /* (B,N,padded) */
    float *h[4], *o[4];          /* (B,N,hidden), (B,N,attribute) */
    float *raw, *draw;           /* (B,N,colors + 8) */
    void *grad[2];
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
    for (int i = 0; i < 4; i++) {
        nn_name(name, "%sfeature_layers.%d", prefix, 2 * i);
        linear_init(&im->trunk[i], ps, name, i ? width : in, width);
        im->trunk[i].act = i < 3 ? ACT_RELU : ACT_NONE;
        ps->tensor[im->trunk[i].weight].gain = i < 3 ? 1.4142135f : 1;
    }
    for (int i = 0; i < 4; i++) {
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

void mlp_decoder_learn_colors(struct mlp_decoder *d, struct params *ps)
{
    for (int i = 1; i < ATTRIBUTE_HEADS; i++) {
        const struct conv *layer[2] = { &d->impl->inner[i], &d->impl->outer[i] };

        for (int k = 0; k < 2; k++)
            ps->tensor[layer[k]->weight].frozen =
                ps->tensor[layer[k]->bias].frozen = true;
    }
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
    im->dx = im->halves ? NULL : nn_plan_floats(p, rows * im->padded);
    im->dsum = im->halves ? NULL : nn_plan_floats(p, rows * im->padded);
    im->draw = nn_plan_floats(p, rows * (d->head.colors + 8));
    im->dgamma = nn_plan_floats(p, d->batch * HARMONIC_OUT);
}

/* The heads, one after another. */
static void mlp_decoder_plan_heads(struct mlp_decoder *d, size_t rows)
{
    struct mlp_decoder_impl *im = d->impl;
    struct nn_plan *p = &im->plan;

    im->x = nn_plan_map(p, rows * im->padded);
    for (int i = 0; i < ATTRIBUTE_HEADS; i++) {
        im->inner[i].in_data = im->padded;
        im->h[i] = nn_plan_map(p, rows * d->hidden);
        linear_plan(&im->inner[i], p, rows);
        im->o[i] = nn_plan_map(p, rows * mlp_decoder_width(d, i));
        linear_plan(&im->outer[i], p, rows);
        nn_plan_recycle(p, im->h[i]);
    }
}

/* Whether maps are halves: of one picture, and where every layer fills whole
 * vectors (the gradients of others' inputs are computed in float). */
static bool mlp_decoder_halves(const struct mlp_decoder *d)
{
    const struct mlp_decoder_impl *im = d->impl;

    return d->batch == 1 && d->width % 16 == 0 &&
           ATTRIBUTE_HEADS * d->hidden % 16 == 0 &&
           attribute_heads_wanted(im->inner, im->outer, &im->plan);
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
    im->raw = nn_plan_map(p, rows * (d->head.colors + 8));
    im->halves = mlp_decoder_halves(d);
    for (int i = 0; i < 4; i++) {
        im->y[i] = nn_plan_map(p, rows * d->width);
        im->trunk[i].half_in = im->halves && i > 0;
        im->trunk[i].half_out = im->halves;
        linear_plan(&im->trunk[i], p, rows);
        if (i)
            nn_plan_recycle(p, im->y[i - 1]);
    }
    if (im->halves)
        attribute_heads_plan(&im->heads, im->inner, im->outer, p, rows,
                             d->width);
    else
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
PARALLEL(mlp_decoder_gather_part, r, float *const *, part,
         struct mlp_decoder_impl *, im, _Bool, back, int, i, size_t, n,
         size_t, row, size_t, at)
{
    if (back)
        memcpy(part[i] + r * n, im->draw + r * row + at, n * sizeof(float));
    else
        memcpy(im->raw + r * row + at, part[i] + r * n, n * sizeof(float));
}

/* raw (rows,colors+8) <-> the four attributes' own arrays. */
static void mlp_decoder_gather(struct mlp_decoder *d, float *const part[4],
                               bool back)
{
    struct mlp_decoder_impl *im = d->impl;
    size_t rows = d->batch * d->points, row = d->head.colors + 8, at = 0;

    for (int i = 0; i < im->wanted; i++) {
        size_t n = mlp_decoder_width(d, i);

        parallel_each(mlp_decoder_gather_part, rows, 1, part, im, back, i, n,
                      row, at);
        at += n;
    }
}

/* raw from y[3] and gamma. */
static void mlp_decoder_heads(struct mlp_decoder *d)
{
    struct mlp_decoder_impl *im = d->impl;

    concat_forward(im->x, im->y[3], im->gamma, d->batch * d->points, d->width,
                   HARMONIC_OUT, im->padded, d->points);
    for (int i = 0; i < im->wanted; i++) {
        conv_forward(im->h[i], im->x, &im->inner[i]);
        conv_forward(im->o[i], im->h[i], &im->outer[i]);
    }
    mlp_decoder_gather(d, im->o, false);
}

/* Reverse of mlp_decoder_heads: dy (B,N,width) from draw; b is scratch. */
static void mlp_decoder_heads_backward(float *dy, float *b, bool dir,
                                       struct mlp_decoder *d)
{
    struct mlp_decoder_impl *im = d->impl;
    size_t rows = d->batch * d->points;

    mlp_decoder_gather(d, im->o, true);       /* o[i] holds its gradient now */
    for (int i = 0; i < im->wanted; i++) {
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
    im->wanted = out->opacity ? ATTRIBUTE_HEADS : 1;
    conv_forward(im->y[0], features, &im->trunk[0]);
    for (int i = 1; i < 4; i++)
        conv_forward(im->y[i], im->y[i - 1], &im->trunk[i]);
    harmonic_forward(im->gamma, dir, d->batch);
    if (im->halves)
        attribute_heads_forward(im->raw, im->y[3], im->gamma, &im->heads);
    else
        mlp_decoder_heads(d);
    gaussian_head_forward(out, im->raw, rgb_logit, &d->head, d->batch,
                          d->points, d->head.colors + 8, d->points);
}

void mlp_decoder_backward(float *dfeatures, float *ddir,
                          const struct gaussian_out *dout, const float *dir,
                          const float *rgb_logit, struct mlp_decoder *d)
{
    struct mlp_decoder_impl *im = d->impl;
    void *a = im->grad[0], *b = im->grad[1];

    gaussian_head_backward(im->draw, NULL, dout, im->raw, rgb_logit,
                           &d->head, d->batch, d->points, d->head.colors + 8,
                           d->points);
    memset(im->dgamma, 0, d->batch * HARMONIC_OUT * sizeof *im->dgamma);
    if (im->halves)
        attribute_heads_backward(a, im->dgamma, im->draw, im->raw, im->y[3],
                                 &im->heads);
    else
        mlp_decoder_heads_backward(a, b, ddir != NULL, d);
    if (ddir) {
        memset(ddir, 0, 3 * d->batch * sizeof *ddir);
        harmonic_backward(ddir, im->dgamma, dir, d->batch);
    }
    for (int i = 3; i > 0; i--) {
        conv_backward(b, a, im->y[i], im->y[i - 1], &im->trunk[i]);
        void *swap = a;
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
    int x = GRAPH_INPUT(g, "features", N, d->in), part[4];
    int gamma = harmonic_graph(g, GRAPH_INPUT(g, "direction", 1, 3));
    int logit = GRAPH_INPUT(g, "rgb_logit", N, 3);

    for (int i = 0; i < 4; i++)
        x = graph_linear(g, x, &im->trunk[i]);
    gamma = GRAPH_NODE(g, "Expand", gamma,
                       GRAPH_INTS(g, (int64_t)N, HARMONIC_OUT));
    x = graph_concat(g, x, gamma);
    for (int i = 0; i < 4; i++)
        part[i] = graph_linear(g, graph_linear(g, x, &im->inner[i]),
                               &im->outer[i]);
    int raw = graph_node(g, "Concat", part, 4);
    graph_set_int(g, "axis", 1);
    gaussian_head_graph(g, raw, logit, N, &d->head);
}
