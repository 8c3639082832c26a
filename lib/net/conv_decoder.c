/* Phi_S and Phi_M (Section 3.2): from a feature image and the viewing
 * direction to one Gaussian per pixel. */
#include "lib/net/conv_decoder.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/net/harmonic.h"
#include "lib/nn/conv.h"
#include "lib/nn/image.h"

struct conv_decoder_impl {
    struct nn_plan plan;
    struct conv conv[4];
    size_t padded;               /* in + gamma or 1, a multiple of 16 */
    float *gamma, *dgamma;       /* (B,27) */
    /* Of one image gamma is the same in all of its pixels: one channel of ones
     * with weights of its own stands for its 27.  NULL where several images are
     * one batch, and where it learns in float, as the paper's sums are. */
    float *folded, *dfolded;     /* (width,in + 1,3,3) */
    float *x;                    /* (B,h,w,padded) */
    void *y[3];                  /* (B,h,w,width), bfloat16 where they may be */
    float *raw;                  /* (B,h,w,head) */
    float *grad[2], *dx;
};

int conv_decoder_init(struct conv_decoder *d, struct params *ps,
                      const char *prefix, size_t in, size_t width,
                      struct gaussian_head head, struct error *err)
{
    char name[120];

    memset(d, 0, sizeof *d);
    d->impl = calloc(1, sizeof *d->impl);
    if (!d->impl)
        return error_set(err, EX_OSERR, "out of memory");
    d->head = head;
    d->in = in;
    d->width = width;
    for (int i = 0; i < 4; i++) {
        struct conv *c = &d->impl->conv[i];

        conv_init(c, ps, nn_name(name, "%sgaussian_conv.%d", prefix, 2 * i),
                  i ? width : in + HARMONIC_OUT,
                  i < 3 ? width : gaussian_head_width(&head), i < 3 ? 3 : 1,
                  1, true);
        c->act = i < 3 ? ACT_RELU : ACT_NONE;
        ps->tensor[c->weight].gain = i < 3 ? 1.4142135f : 0.3f;
    }
    return 0;
}

/* ---- gamma as one channel ------------------------------------------------ */

#define TAPS 9                   /* of the first layer's kernel */

/* Decide on it; the first layer then has its own weights. */
static void conv_decoder_plan_fold(struct conv_decoder *d)
{
    struct conv_decoder_impl *im = d->impl;
    struct conv *c = &im->conv[0];
    struct nn_plan *p = &im->plan;
    const bool learns = conv_halves(p) && !c->ps->tensor[c->weight].frozen;
    const bool fold = d->batch == 1 && (learns || !nn_plan_backward(p));
    const size_t n = d->width * (d->in + 1) * TAPS;

    im->folded = fold ? nn_plan_floats(p, n) : NULL;
    im->dfolded = fold && learns ? nn_plan_floats(p, n) : NULL;
    c->from = im->folded;
    c->from_g = im->dfolded;
    c->in = d->in + (fold ? 1 : HARMONIC_OUT);
    im->padded = (c->in + 15) / 16 * 16;
    c->in_data = im->padded;
}

/* The weights of the ones: gamma through its own. */
static void conv_decoder_fold(struct conv_decoder *d)
{
    struct conv_decoder_impl *im = d->impl;
    const size_t own = d->in * TAPS, all = own + HARMONIC_OUT * TAPS;
    const float *w = param_w(im->conv[0].ps, im->conv[0].weight);

    for (size_t o = 0; o < d->width; o++, w += all) {
        float *to = im->folded + o * (own + TAPS), *ones = to + own;

        memcpy(to, w, own * sizeof *to);
        memset(ones, 0, TAPS * sizeof *ones);
        for (size_t i = 0; i < HARMONIC_OUT * TAPS; i++)
            ones[i % TAPS] += im->gamma[i / TAPS] * w[own + i];
    }
    conv_update(&im->conv[0]);
}

/* In the forward pass: ones[t] += gamma[j] w[in + j][t]. */
static void conv_decoder_fold_backward(struct conv_decoder *d)
{
    struct conv_decoder_impl *im = d->impl;
    const size_t own = d->in * TAPS, all = own + HARMONIC_OUT * TAPS;
    const float *w = param_w(im->conv[0].ps, im->conv[0].weight);
    float *g = param_g(im->conv[0].ps, im->conv[0].weight);

    for (size_t o = 0; o < d->width; o++, w += all, g += all) {
        const float *from = im->dfolded + o * (own + TAPS);
        const float *dones = from + own;

        for (size_t i = 0; i < own; i++)
            g[i] += from[i];
        for (size_t i = 0; i < HARMONIC_OUT * TAPS; i++) {
            g[own + i] += im->gamma[i / TAPS] * dones[i % TAPS];
            im->dgamma[i / TAPS] += w[own + i] * dones[i % TAPS];
        }
    }
}

/* ---- the network --------------------------------------------------------- */

int conv_decoder_plan(struct conv_decoder *d, size_t batch, size_t height,
                      size_t width, struct nn_options opt, struct error *err)
{
    struct conv_decoder_impl *im = d->impl;
    struct nn_plan *p = &im->plan;
    size_t pixels = batch * height * width, raw = gaussian_head_width(&d->head);

    nn_plan_release(p);
    nn_plan_init(p, opt);
    d->batch = batch;
    d->height = height;
    d->image_w = width;
    conv_decoder_plan_fold(d);
    im->gamma = nn_plan_floats(p, batch * HARMONIC_OUT);
    im->x = nn_plan_map(p, pixels * im->padded);
    for (int i = 0; i < 4; i++) {
        float *y = nn_plan_map(p, pixels * (i < 3 ? d->width : raw));

        if (i < 3)
            im->y[i] = y;
        else
            im->raw = y;
        im->conv[i].half_in = i > 0 && conv_halves(p);
        im->conv[i].half_out = i < 3 && conv_halves(p);
        conv_plan(&im->conv[i], p, batch, height, width);
        nn_plan_recycle(p, i ? im->y[i - 1] : im->x);
    }
    if (nn_plan_backward(p)) {
        size_t max = d->width > raw ? d->width : raw;

        im->grad[0] = nn_plan_floats(p, pixels * max);
        im->grad[1] = nn_plan_floats(p, pixels * max);
        im->dx = nn_plan_floats(p, pixels * im->padded);
        im->dgamma = nn_plan_floats(p, batch * HARMONIC_OUT);
    }
    return nn_plan_finish(p, err);
}

void conv_decoder_release(struct conv_decoder *d)
{
    if (!d->impl)
        return;
    nn_plan_release(&d->impl->plan);
    free(d->impl);
    memset(d, 0, sizeof *d);
}

float *conv_decoder_rows(size_t *stride, const struct conv_decoder *d)
{
    *stride = d->impl->padded;
    return d->impl->x;
}

void conv_decoder_forward(struct gaussian_out *out, const float *features,
                          const float *dir, const float *rgb_logit,
                          struct conv_decoder *d)
{
    static const float one = 1;
    struct conv_decoder_impl *im = d->impl;
    size_t N = d->height * d->image_w;

    harmonic_forward(im->gamma, dir, d->batch);
    if (im->folded)
        conv_decoder_fold(d);
    concat_forward(im->x, features, im->folded ? &one : im->gamma,
                   d->batch * N, d->in, im->folded ? 1 : HARMONIC_OUT,
                   im->padded, N);
    conv_forward(im->y[0], im->x, &im->conv[0]);
    conv_forward(im->y[1], im->y[0], &im->conv[1]);
    conv_forward(im->y[2], im->y[1], &im->conv[2]);
    conv_forward(im->raw, im->y[2], &im->conv[3]);
    gaussian_head_forward(out, im->raw, rgb_logit, &d->head, d->batch, N,
                          gaussian_head_width(&d->head), d->image_w);
}

void conv_decoder_backward(float *dfeatures, float *ddir, float *drgb_logit,
                           const struct gaussian_out *dout,
                           const float *dir, const float *rgb_logit,
                           struct conv_decoder *d)
{
    struct conv_decoder_impl *im = d->impl;
    size_t N = d->height * d->image_w;
    float *a = im->grad[0], *b = im->grad[1];
    bool input = dfeatures || ddir;

    gaussian_head_backward(a, drgb_logit, dout, im->raw, rgb_logit, &d->head,
                           d->batch, N, gaussian_head_width(&d->head),
                           d->image_w);
    conv_backward(b, a, im->raw, im->y[2], &im->conv[3]);
    conv_backward(a, b, im->y[2], im->y[1], &im->conv[2]);
    conv_backward(b, a, im->y[1], im->y[0], &im->conv[1]);
    if (im->folded)
        memset(im->dfolded, 0, d->width * (d->in + 1) * TAPS *
                                   sizeof *im->dfolded);
    conv_backward(input ? im->dx : NULL, b, im->y[0], im->x, &im->conv[0]);
    memset(im->dgamma, 0, d->batch * HARMONIC_OUT * sizeof *im->dgamma);
    if (im->folded)
        conv_decoder_fold_backward(d);
    if (!input)
        return;
    concat_backward(dfeatures, ddir && !im->folded ? im->dgamma : NULL,
                    im->dx, d->batch * N, d->in, HARMONIC_OUT, im->padded, N);
    if (ddir) {
        memset(ddir, 0, 3 * d->batch * sizeof *ddir);
        harmonic_backward(ddir, im->dgamma, dir, d->batch);
    }
}

/* ---- as a graph ---------------------------------------------------------- */

void conv_decoder_graph(struct graph *g, size_t n,
                        const struct conv_decoder *d)
{
    const int64_t N = (int64_t)(n * n), side = (int64_t)n;
    int features = GRAPH_INPUT(g, "features", 1, n, n, d->in);
    int gamma = harmonic_graph(g, GRAPH_INPUT(g, "direction", 1, 3));
    int logit = GRAPH_INPUT(g, "rgb_logit", n * n, 3);

    gamma = GRAPH_NODE(g, "Reshape", gamma,
                       GRAPH_INTS(g, 1, HARMONIC_OUT, 1, 1));
    gamma = GRAPH_NODE(g, "Expand", gamma,
                       GRAPH_INTS(g, 1, HARMONIC_OUT, side, side));
    int x = graph_concat(g, graph_maps(g, features), gamma);
    for (int i = 0; i < 4; i++)
        x = graph_conv(g, x, &d->impl->conv[i]);
    x = GRAPH_NODE(g, "Reshape", graph_rows(g, x), GRAPH_INTS(g, N, -1));
    gaussian_head_graph(g, x, logit, n * n, &d->head);
}
