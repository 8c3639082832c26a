/* Phi_D's four heads as two layers: gathering their weights, and giving them
 * their gradients. */
#include "lib/net/attribute_heads.h"

#include <string.h>

#include "lib/net/harmonic.h"

enum { HIDDEN, LAST };

bool attribute_heads_wanted(const struct conv inner[ATTRIBUTE_HEADS],
                            const struct conv outer[ATTRIBUTE_HEADS],
                            const struct nn_plan *p)
{
    bool learn = conv_halves(p);

    for (int i = 0; i < ATTRIBUTE_HEADS; i++) {
        const struct param *t = inner[i].ps->tensor;

        learn = learn && !t[inner[i].weight].frozen &&
                !t[inner[i].bias].frozen && !t[outer[i].weight].frozen &&
                !t[outer[i].bias].frozen;
    }
    return learn;
}

/* One of the two layers: in -> out, weights and bias of its own. */
static void attribute_heads_layer(struct attribute_heads *a, int which,
                                  size_t in, size_t out)
{
    struct conv *c = which == HIDDEN ? &a->hidden : &a->last;
    const struct conv *like = which == HIDDEN ? a->inner : a->outer;

    a->w[which] = nn_plan_floats(a->plan, in * out);
    a->b[which] = nn_plan_floats(a->plan, out);
    a->dw[which] = nn_plan_floats(a->plan, in * out);
    a->db[which] = nn_plan_floats(a->plan, out);
    *c = (struct conv){
        .ps = like->ps, .weight = like->weight, .bias = like->bias, .in = in,
        .out = out, .kernel = 1, .stride = 1, .gamma = NN_NONE,
        .act = like->act, .half_in = true, .half_out = which == HIDDEN,
        .from = a->w[which], .from_bias = a->b[which],
        .from_g = a->dw[which], .from_bias_g = a->db[which], .impl = c->impl
    };
    linear_plan(c, a->plan, a->rows);
}

void attribute_heads_plan(struct attribute_heads *a,
                          const struct conv inner[ATTRIBUTE_HEADS],
                          const struct conv outer[ATTRIBUTE_HEADS],
                          struct nn_plan *p, size_t rows, size_t width)
{
    size_t hidden = 0, out = 0;

    for (int i = 0; i < ATTRIBUTE_HEADS; i++) {
        hidden += inner[i].out;
        out += outer[i].out;
    }
    a->inner = inner;
    a->outer = outer;
    a->plan = p;
    a->rows = rows;
    a->width = width;
    a->h = nn_plan_bytes(p, rows * hidden * sizeof *a->h);
    a->dh = nn_plan_bytes(p, rows * hidden * sizeof *a->dh);
    attribute_heads_layer(a, HIDDEN, width, hidden);
    attribute_heads_layer(a, LAST, hidden, out);
}

/* Head i's hidden layer, from its row `at` on: bias + gamma's part. */
static void attribute_heads_gather(struct attribute_heads *a, int i, size_t at)
{
    const struct conv *c = &a->inner[i];
    const float *w = param_w(c->ps, c->weight), *b = param_w(c->ps, c->bias);

    for (size_t o = 0; o < c->out; o++, w += c->in) {
        float sum = b[o];

        memcpy(a->w[HIDDEN] + (at + o) * a->width, w, a->width * sizeof *w);
        for (size_t j = 0; j < HARMONIC_OUT; j++)
            sum += a->gamma[j] * w[a->width + j];
        a->b[HIDDEN][at + o] = sum;
    }
}

/* In the forward pass: attribute_heads_gather. */
static void attribute_heads_spread(float *dgamma, struct attribute_heads *a,
                                   int i, size_t at)
{
    const struct conv *c = &a->inner[i];
    const float *w = param_w(c->ps, c->weight);
    float *g = param_g(c->ps, c->weight), *gb = param_g(c->ps, c->bias);

    for (size_t o = 0; o < c->out; o++, w += c->in, g += c->in) {
        const float d = a->db[HIDDEN][at + o];

        for (size_t k = 0; k < a->width; k++)
            g[k] += a->dw[HIDDEN][(at + o) * a->width + k];
        for (size_t j = 0; j < HARMONIC_OUT; j++) {
            g[a->width + j] += d * a->gamma[j];
            dgamma[j] += d * w[a->width + j];
        }
        gb[o] += d;
    }
}

/* Where head i's part of a row of the last layer's weights begins: `to` rows
 * down, `in` numbers across. */
static size_t attribute_heads_block(const struct attribute_heads *a,
                                    size_t row, size_t in)
{
    return row * a->last.in + in;
}

void attribute_heads_forward(float *raw, const uint16_t *y, const float *gamma,
                             struct attribute_heads *a)
{
    a->gamma = gamma;
    for (size_t i = 0, in = 0, row = 0; i < ATTRIBUTE_HEADS; i++) {
        const struct conv *c = &a->outer[i];
        const float *w = param_w(c->ps, c->weight);

        attribute_heads_gather(a, (int)i, in);
        for (size_t o = 0; o < c->out; o++)
            memcpy(a->w[LAST] + attribute_heads_block(a, row + o, in),
                   w + o * c->in, c->in * sizeof *w);
        memcpy(a->b[LAST] + row, param_w(c->ps, c->bias),
               c->out * sizeof *w);
        in += a->inner[i].out;
        row += c->out;
    }
    conv_update(&a->hidden);
    conv_update(&a->last);
    conv_forward(a->h, y, &a->hidden);
    conv_forward(raw, a->h, &a->last);
}

void attribute_heads_backward(uint16_t *dy, float *dgamma, float *draw,
                              const float *raw, const uint16_t *y,
                              struct attribute_heads *a)
{
    const struct conv *layer[2] = { &a->hidden, &a->last };

    for (int k = 0; k < 2; k++) {
        memset(a->dw[k], 0, layer[k]->in * layer[k]->out * sizeof *a->dw[k]);
        memset(a->db[k], 0, layer[k]->out * sizeof *a->db[k]);
    }
    conv_backward(a->dh, draw, raw, a->h, &a->last);
    conv_backward(dy, a->dh, a->h, y, &a->hidden);
    for (size_t i = 0, in = 0, row = 0; i < ATTRIBUTE_HEADS; i++) {
        const struct conv *c = &a->outer[i];
        float *g = param_g(c->ps, c->weight), *gb = param_g(c->ps, c->bias);

        attribute_heads_spread(dgamma, a, (int)i, in);
        for (size_t o = 0; o < c->out; o++) {
            const float *d = a->dw[LAST] +
                             attribute_heads_block(a, row + o, in);

            for (size_t k = 0; k < c->in; k++)
                g[o * c->in + k] += d[k];
            gb[o] += a->db[LAST][row + o];
        }
        in += a->inner[i].out;
        row += c->out;
    }
}
