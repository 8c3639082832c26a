/* The patch discriminator against a network in double precision: verdicts,
 * hinge, penalty and the gradient to the picture by its own backward, gradients
 * by weights by central differences; windows at the border; the same bits for
 * any number of threads; nothing of an empty face. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/parallel.h"
#include "lib/base/random.h"
#include "lib/lab/train/discriminator.h"
#include "tests/check.h"
#include "tests/reference/act.h"
#include "tests/unit/noise.h"

static struct nn_plans plans;

#define S 64                    /* side of the pictures */
#define N (3 * S * S)
#define L DISCRIMINATOR_LAYERS
#define GAMMA 7.0
#define SCALE 0.3

/* The network in double, for one window. */
struct reference {
    size_t side[L + 1], channels[L + 1];
    double *w[L], *b[L];            /* (out,k,k,in), (out) */
    double *x[L + 1], *g[L + 1];    /* (side,side,channels) */
};

static float a[N], b[N], db[N];

/* Layer i of d, as the reference sees it. */
static size_t reference_kernel(const struct discriminator *d, size_t i)
{
    return d->layer[i].kernel;
}

static double *reference_floats(size_t n)
{
    double *x = calloc(n, sizeof *x);

    if (!x)
        exit(1);
    return x;
}

/* d's sizes and weights. */
static void reference_init(struct reference *r, const struct discriminator *d)
{
    r->side[0] = d->side;
    r->channels[0] = 3;
    for (size_t i = 0; i < L; i++) {
        const struct conv *c = &d->layer[i];
        size_t taps = c->kernel * c->kernel;
        const float *w = param_w(&d->ps, c->weight);

        r->side[i + 1] = (r->side[i] + c->stride - 1) / c->stride;
        r->channels[i + 1] = c->out;
        r->w[i] = reference_floats(c->out * c->in * taps);
        r->b[i] = reference_floats(c->out);
        for (size_t o = 0; o < c->out; o++)
            for (size_t k = 0; k < c->in * taps; k++)
                r->w[i][(o * taps + k % taps) * c->in + k / taps] =
                    (double)w[o * c->in * taps + k];
        for (size_t o = 0; o < c->out; o++)
            r->b[i][o] = (double)param_w(&d->ps, c->bias)[o];
    }
    for (size_t i = 0; i <= L; i++) {
        size_t n = r->side[i] * r->side[i] * r->channels[i];

        r->x[i] = reference_floats(n);
        r->g[i] = reference_floats(n);
    }
}

static void reference_release(struct reference *r)
{
    for (size_t i = 0; i <= L; i++) {
        free(r->x[i]);
        free(r->g[i]);
        if (i < L) {
            free(r->w[i]);
            free(r->b[i]);
        }
    }
}

/* Pixel (y,x) of layer i's output, forward; or, back, its gradient to the
 * input's. */
static void reference_pixel(struct reference *r, const struct discriminator *d,
                            size_t i, size_t y, size_t x, bool back)
{
    size_t k = reference_kernel(d, i), s = d->layer[i].stride;
    size_t n = r->side[i], in = r->channels[i], out = r->channels[i + 1];
    /* TensorFlow's padding: the odd one goes right and down */
    long pad = (long)((r->side[i + 1] - 1) * s + k - n) / 2;
    double *to = r->x[i + 1] + (y * r->side[i + 1] + x) * out;
    const double *g = r->g[i + 1] + (y * r->side[i + 1] + x) * out;

    for (size_t o = 0; o < out; o++) {
        double sum = r->b[i][o], slope = 1;

        if (back && i + 1 < L)
            slope = act_slope(ACT_LRELU, to[o]);
        for (size_t v = 0; v < k; v++)
            for (size_t u = 0; u < k; u++) {
                long py = (long)(y * s + v) - pad, px = (long)(x * s + u) - pad;

                if (py < 0 || px < 0 || py >= (long)n || px >= (long)n)
                    continue;
                size_t at = ((size_t)py * n + (size_t)px) * in;
                const double *w = r->w[i] + ((o * k + v) * k + u) * in;
                for (size_t c = 0; c < in; c++) {
                    sum += w[c] * r->x[i][at + c];
                    if (back)
                        r->g[i][at + c] += w[c] * slope * g[o];
                }
            }
        if (!back)
            to[o] = i + 1 < L ? act_value(ACT_LRELU, sum) : sum;
    }
}

/* All layers from r->x[0], or back from r->g[L]. */
static void reference_run(struct reference *r, const struct discriminator *d,
                          bool back)
{
    for (size_t k = 0; k < L; k++) {
        size_t i = back ? L - 1 - k : k, n = r->side[i];

        if (back)
            memset(r->g[i], 0, n * n * r->channels[i] * sizeof *r->g[i]);
        for (size_t y = 0; y < r->side[i + 1]; y++)
            for (size_t x = 0; x < r->side[i + 1]; x++)
                reference_pixel(r, d, i, y, x, back);
    }
}

/* The window that begins at (x0,y0) of a picture. */
static void reference_look(struct reference *r, const struct discriminator *d,
                           const float *picture, size_t x0, size_t y0)
{
    for (size_t y = 0; y < d->side; y++)
        for (size_t i = 0; i < 3 * d->side; i++)
            r->x[0][3 * y * d->side + i] =
                2 * (double)picture[3 * ((y0 + y) * S + x0) + i] - 1;
    reference_run(r, d, false);
}

/* What discriminator_learn returns; penalty only where gamma is not 0. */
static void reference_learn(double terms[2], struct reference *r,
                            const struct discriminator *d, size_t x0,
                            size_t y0, double gamma)
{
    size_t n = d->patches;

    terms[0] = terms[1] = 0;
    reference_look(r, d, b, x0, y0);
    for (size_t i = 0; i < n; i++)
        terms[0] += fmax(0, 1 + r->x[L][i]) / (double)n * SCALE;
    reference_look(r, d, a, x0, y0);
    for (size_t i = 0; i < n; i++) {
        terms[0] += fmax(0, 1 - r->x[L][i]) / (double)n * SCALE;
        r->g[L][i] = 1;
    }
    if (gamma == 0)
        return;
    reference_run(r, d, true);
    for (size_t i = 0; i < 3 * d->side * d->side; i++)
        terms[1] += gamma / 2 * SCALE * r->g[0][i] * r->g[0][i] / (double)n;
}

/* ---- checks ------------------------------------------------------------- */

/* Biases that are not 0, and verdicts large enough for hinges to matter. */
static void shake(struct discriminator *d)
{
    struct random r;

    random_init(&r, 3, "biases");
    for (size_t i = 0; i < L; i++) {
        const struct conv *c = &d->layer[i];

        for (size_t o = 0; o < c->out; o++)
            param_w(&d->ps, c->bias)[o] = (float)(0.2 * random_normal(&r));
        for (size_t k = 0; i + 1 == L && k < d->ps.tensor[c->weight].count; k++)
            param_w(&d->ps, c->weight)[k] *= 2;
    }
    nn_plans_update(&plans, true);
}

/* The generator's loss and its gradient, within and outside of the window. */
static void check_fool(struct discriminator *d, struct reference *r,
                       const struct box *face, size_t x0, size_t y0)
{
    double want = 0, worst = 0, size = 0, outside = 0;

    memset(db, 0, sizeof db);
    double got = discriminator_fool(db, b, face, 0.7, d);
    reference_look(r, d, b, x0, y0);
    for (size_t i = 0; i < d->patches; i++) {
        want -= 0.7 * r->x[L][i] / (double)d->patches;
        r->g[L][i] = -0.7 / (double)d->patches;
    }
    reference_run(r, d, true);
    for (size_t y = 0; y < S; y++)
        for (size_t x = 0; x < S; x++)
            for (size_t c = 0; c < 3; c++) {
                double g = (double)db[3 * (y * S + x) + c];
                bool in = y >= y0 && x >= x0 && y < y0 + d->side &&
                          x < x0 + d->side;
                double w = in ? 2 * r->g[0][3 * ((y - y0) * d->side + x - x0) +
                                            c] : 0;
                worst = fmax(worst, in ? fabs(g - w) : 0);
                size = fmax(size, fabs(w));
                outside += in ? 0 : fabs(g);
            }
    expect("the drawn picture's loss", got, want, 1e-6);
    check("its gradient", worst / size, 1e-5);
    check("its gradient outside of the window", outside, 0);
}

/* The worst gradient of a term by layer i's weights or biases against central
 * differences of the reference, over the largest one. */
static double check_layer(struct discriminator *d, struct reference *r,
                          const float *g, bool bias, int term, size_t i)
{
    const struct conv *c = &d->layer[i];
    size_t taps = c->kernel * c->kernel;
    size_t count = bias ? c->out : c->out * c->in * taps;
    double worst = 0, size = 1e-12, eps = 1e-6;

    for (size_t j = 0; j < 9; j++) {
        size_t k = (j * 7919 + 5) % count, o = k / (c->in * taps);
        size_t in = k / taps % c->in, at = (o * taps + k % taps) * c->in + in;
        double *w = bias ? &r->b[i][k] : &r->w[i][at], keep = *w;
        double f[2][2];

        for (int s = 0; s < 2; s++) {
            *w = keep + (s ? eps : -eps);
            reference_learn(f[s], r, d, 10, 12, term ? GAMMA : 0);
        }
        *w = keep;
        double want = (f[1][term] - f[0][term]) / (2 * eps);
        worst = fmax(worst, fabs((double)g[k] - want));
        size = fmax(size, fabs(want));
    }
    return worst / size;
}

/* The discriminator's own losses and their gradients; hinge and penalty apart,
 * for the second is the difference of what is there with it and without. */
static void check_learn(struct discriminator *d, struct reference *r,
                        const struct box *face)
{
    size_t total = d->ps.total;
    float *g = calloc(2 * total, sizeof *g), *hinge = g, *penalty = g + total;
    double terms[2] = {0}, want[2];

    if (!g)
        exit(1);
    memset(d->ps.g, 0, total * sizeof *g);
    discriminator_learn(terms, b, a, face, 0, SCALE, d);
    memcpy(hinge, d->ps.g, total * sizeof *g);
    check("no penalty", fabs(terms[1]), 0);
    memset(terms, 0, sizeof terms);
    discriminator_learn(terms, b, a, face, GAMMA, SCALE, d);
    for (size_t i = 0; i < total; i++)      /* gradients are added */
        penalty[i] = d->ps.g[i] - 2 * hinge[i];
    reference_learn(want, r, d, 10, 12, GAMMA);
    expect("hinge", terms[0], want[0], 1e-6);
    expect("penalty", terms[1] / want[1], 1, 1e-5);
    for (size_t i = 0; i < L; i++) {
        const struct conv *c = &d->layer[i];
        size_t w = d->ps.tensor[c->weight].offset;
        size_t o = d->ps.tensor[c->bias].offset;
        double none = 0;

        check("hinge's gradient by weights",
              check_layer(d, r, hinge + w, false, 0, i), 1e-4);
        check("hinge's gradient by biases",
              check_layer(d, r, hinge + o, true, 0, i), 1e-4);
        check("penalty's gradient by weights",
              check_layer(d, r, penalty + w, false, 1, i), 1e-4);
        for (size_t k = 0; k < c->out; k++)
            none = fmax(none, fabs((double)penalty[o + k]));
        check("penalty's gradient by biases", none, 1e-6);
    }
    free(g);
}

/* Sums of everything that comes out, as bits. */
static uint64_t everything(struct discriminator *d, const struct box *face,
                           int threads)
{
    double terms[2] = {0};
    uint64_t h = 0, word;
    uint32_t bits;

    parallel_set_width(threads);
    memset(d->ps.g, 0, d->ps.total * sizeof *d->ps.g);
    memset(db, 0, sizeof db);
    terms[0] = discriminator_fool(db, b, face, 0.7, d);
    discriminator_learn(terms, b, a, face, GAMMA, SCALE, d);
    for (int k = 0; k < 2; k++) {
        memcpy(&word, &terms[k], sizeof word);
        h = random_mix(h ^ word);
    }
    for (size_t i = 0; i < N; i++) {
        memcpy(&bits, &db[i], sizeof bits);
        h = random_mix(h ^ bits);
    }
    for (size_t i = 0; i < d->ps.total; i++) {
        memcpy(&bits, &d->ps.g[i], sizeof bits);
        h = random_mix(h ^ bits);
    }
    return h;
}

int main(void)
{
    const struct box face = {16, 20, 44, 44}, none = {5, 5, 5, 9};
    const struct box corner = {50, 0, 64, 12};
    size_t confidence = 0;
    struct discriminator d;
    struct reference r;
    struct error err = {0};
    double terms[2] = {0};

    nn_plans_use(&plans);
    check_error("init", !discriminator_init(&d, S, 11, &err), &err);
    shake(&d);
    noise_waves(a, "discriminator", N, 1, S, 0);
    noise_waves(b, "discriminator", N, 2, S, 0.7);
    reference_init(&r, &d);
    expect("the window's side", (double)d.side, 40, 0);
    check_fool(&d, &r, &face, 10, 12);
    check_fool(&d, &r, &corner, 24, 0);
    check_learn(&d, &r, &face);
    for (size_t i = 0; i < d.patches; i++)      /* the last is of a */
        confidence += d.x[L][i] > 1;
    check_range("patches beyond the hinge", (double)confidence, 1,
                (double)d.patches - 1);
    check_that("any number of threads", everything(&d, &face, 1) ==
                                            everything(&d, &face, 3));
    memset(d.ps.g, 0, d.ps.total * sizeof *d.ps.g);
    check("an empty face", discriminator_fool(db, b, &none, 1, &d), 0);
    discriminator_learn(terms, b, a, &none, GAMMA, SCALE, &d);
    check("an empty face teaches", terms[0] + terms[1], 0);
    reference_release(&r);
    discriminator_release(&d);
    nn_plans_release(&plans);
    return check_status();
}
