/* Phi_S and Phi_M (Section 3.2): from a feature image and the viewing
 * direction to one Gaussian per pixel. */
#include "lib/net/conv_decoder.h"

#include <string.h>

#include "lib/net/harmonic.h"
#include "lib/nn/image.h"

#define TAPS 9                   /* of the first layer's kernel */

/* ---- its own step: gamma behind every pixel's features ------------------------ */

struct conv_gamma {
    struct conv *conv;           /* the first layer, which reads it */
    size_t in;                   /* channels of the features */
    float *gamma, *dgamma;       /* (B,27) */
    /* Of one image gamma is the same in all of its pixels: one channel of ones
     * with weights of its own stands for its 27.  NULL where several images are
     * one batch, and where it learns in float, as the paper's sums are. */
    float *folded, *dfolded;     /* (width,in + 1,3,3) */
};

/* In memory a multiple of 16, the rest zero. */
static void conv_gamma_plan(struct tape_step *s, struct nn_plan *p)
{
    struct conv_gamma *l = s->layer;
    struct conv *c = l->conv;
    const bool learns = conv_halves(p) && !c->ps->tensor[c->weight].frozen;
    const bool fold = s->batch == 1 && (learns || !nn_plan_backward(p));
    const size_t n = c->out * (l->in + 1) * TAPS;

    l->gamma = nn_plan_floats(p, s->batch * HARMONIC_OUT);
    l->dgamma = nn_plan_backward(p)
                    ? nn_plan_floats(p, s->batch * HARMONIC_OUT) : NULL;
    l->folded = fold ? nn_plan_floats(p, n) : NULL;
    l->dfolded = fold && learns ? nn_plan_floats(p, n) : NULL;
    c->from = l->folded;
    c->from_g = l->dfolded;
    c->in = l->in + (fold ? 1 : HARMONIC_OUT);
    c->in_data = s->channels = (c->in + 15) / 16 * 16;
}

static void conv_gamma_forward(struct tape_step *s)
{
    static const float one = 1;
    const struct conv_gamma *l = s->layer;
    const size_t pixels = s->h * s->w;

    concat_forward(s->out, s->of[0]->x, l->folded ? &one : l->gamma,
                   s->batch * pixels, l->in, l->folded ? 1 : HARMONIC_OUT,
                   s->channels, pixels);
}

static void conv_gamma_backward(float *to, struct tape_step *s, int k)
{
    const struct conv_gamma *l = s->layer;
    const size_t pixels = s->h * s->w;

    (void)k;
    concat_backward(to, l->folded ? NULL : l->dgamma, s->d, s->batch * pixels,
                    l->in, HARMONIC_OUT, s->channels, pixels);
}

static const struct tape_op gamma_op = {
    sizeof(struct conv_gamma), 0, true, conv_gamma_plan, conv_gamma_forward,
    conv_gamma_backward, NULL
};

/* The weights of the ones: gamma through its own. */
static void conv_gamma_fold(const struct conv_gamma *l)
{
    const size_t own = l->in * TAPS, all = own + HARMONIC_OUT * TAPS;
    const float *w = param_w(l->conv->ps, l->conv->weight);

    for (size_t o = 0; o < l->conv->out; o++, w += all) {
        float *to = l->folded + o * (own + TAPS), *ones = to + own;

        memcpy(to, w, own * sizeof *to);
        memset(ones, 0, TAPS * sizeof *ones);
        for (size_t i = 0; i < HARMONIC_OUT * TAPS; i++)
            ones[i % TAPS] += l->gamma[i / TAPS] * w[own + i];
    }
    conv_update(l->conv);
}

/* In the forward pass: ones[t] += gamma[j] w[in + j][t]. */
static void conv_gamma_fold_backward(const struct conv_gamma *l)
{
    const size_t own = l->in * TAPS, all = own + HARMONIC_OUT * TAPS;
    const float *w = param_w(l->conv->ps, l->conv->weight);
    float *g = param_g(l->conv->ps, l->conv->weight);

    for (size_t o = 0; o < l->conv->out; o++, w += all, g += all) {
        const float *from = l->dfolded + o * (own + TAPS);
        const float *dones = from + own;

        for (size_t i = 0; i < own; i++)
            g[i] += from[i];
        for (size_t i = 0; i < HARMONIC_OUT * TAPS; i++) {
            g[own + i] += l->gamma[i / TAPS] * dones[i % TAPS];
            l->dgamma[i / TAPS] += w[own + i] * dones[i % TAPS];
        }
    }
}

/* ---- the network ---------------------------------------------------------------- */

void conv_decoder_init(struct conv_decoder *d, struct params *ps,
                       const char *prefix, size_t in, size_t width,
                       struct gaussian_head head)
{
    struct tape *t = &d->tape;
    char name[120];

    *d = (struct conv_decoder){.head = head};
    tape_init(t, ps, in, false);
    d->gamma = TAPE_STEP(t, &gamma_op, 0);
    t->map[d->gamma]->channels = in + HARMONIC_OUT;
    for (int i = 0, x = d->gamma; i < 4; i++) {
        nn_name(name, "%sgaussian_conv.%d", prefix, 2 * i);
        x = tape_conv(t, x, name, i < 3 ? width : gaussian_head_width(&head),
                      i < 3 ? 3 : 1, true);
        struct conv *c = tape_layer(t, x);
        ps->tensor[c->weight].gain = i < 3 ? 1.4142135f : 0.3f;
        if (i == 0)
            *(struct conv_gamma *)t->map[d->gamma]->layer =
                (struct conv_gamma){.conv = c, .in = in};
        if (i < 3) {
            c->act = ACT_RELU;
            tape_halve_map(t, x);
        }
    }
}

int conv_decoder_plan(struct conv_decoder *d, size_t batch, size_t height,
                      size_t width, struct nn_options opt, struct error *err)
{
    return tape_plan(&d->tape, batch, height, width, opt, err);
}

void conv_decoder_release(struct conv_decoder *d)
{
    tape_release(&d->tape);
    memset(d, 0, sizeof *d);
}

float *conv_decoder_rows(size_t *stride, const struct conv_decoder *d)
{
    *stride = d->tape.map[d->gamma]->channels;
    return d->tape.map[d->gamma]->out;
}

/* The map of the raw numbers, (B,h,w,head). */
static const struct tape_step *conv_decoder_raw(const struct conv_decoder *d)
{
    return d->tape.map[d->tape.count - 1];
}

void conv_decoder_forward(struct gaussian_out *out, const float *features,
                          const float *dir, const float *rgb_logit,
                          struct conv_decoder *d)
{
    const struct tape_step *raw = conv_decoder_raw(d);
    const struct conv_gamma *l = d->tape.map[d->gamma]->layer;

    harmonic_forward(l->gamma, dir, raw->batch);
    if (l->folded)
        conv_gamma_fold(l);
    tape_forward(NULL, features, &d->tape);
    gaussian_head_forward(out, raw->x, rgb_logit, &d->head, raw->batch,
                          raw->h * raw->w, raw->channels, raw->w);
}

void conv_decoder_backward(float *dfeatures, float *ddir, float *drgb_logit,
                           const struct gaussian_out *dout,
                           const float *dir, const float *rgb_logit,
                           struct conv_decoder *d)
{
    const struct tape_step *raw = conv_decoder_raw(d);
    const struct conv_gamma *l = d->tape.map[d->gamma]->layer;
    const struct conv *c = l->conv;

    gaussian_head_backward(raw->d, drgb_logit, dout, raw->x, rgb_logit,
                           &d->head, raw->batch, raw->h * raw->w, raw->channels,
                           raw->w);
    memset(l->dgamma, 0, raw->batch * HARMONIC_OUT * sizeof *l->dgamma);
    if (l->folded)
        memset(l->dfolded, 0, c->out * c->in * TAPS * sizeof *l->dfolded);
    tape_backward(dfeatures, &(struct tape_seed){d->tape.count - 1, raw->d}, 1,
                  &d->tape);
    if (l->folded)
        conv_gamma_fold_backward(l);
    if (!ddir)
        return;
    memset(ddir, 0, 3 * raw->batch * sizeof *ddir);
    harmonic_backward(ddir, l->dgamma, dir, raw->batch);
}

/* ---- as a graph ---------------------------------------------------------- */

void conv_decoder_graph(struct graph *g, size_t n,
                        const struct conv_decoder *d)
{
    const int64_t N = (int64_t)(n * n), side = (int64_t)n;
    const struct tape *t = &d->tape;
    int features = GRAPH_INPUT(g, "features", 1, n, n, t->picture.channels);
    int gamma = harmonic_graph(g, GRAPH_INPUT(g, "direction", 1, 3));
    int logit = GRAPH_INPUT(g, "rgb_logit", n * n, 3);

    gamma = GRAPH_NODE(g, "Reshape", gamma,
                       GRAPH_INTS(g, 1, HARMONIC_OUT, 1, 1));
    gamma = GRAPH_NODE(g, "Expand", gamma,
                       GRAPH_INTS(g, 1, HARMONIC_OUT, side, side));
    int x = graph_concat(g, graph_maps(g, features), gamma);
    x = tape_graph(g, x, d->gamma, t->count - 1, t);
    x = GRAPH_NODE(g, "Reshape", graph_rows(g, x), GRAPH_INTS(g, N, -1));
    gaussian_head_graph(g, x, logit, n * n, &d->head);
}
