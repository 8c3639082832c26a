/* Blocks of transformers, forward and backward. */
#include "lib/nn/transformer.h"

#include <math.h>
#include <string.h>

#include "lib/base/parallel.h"
#include "lib/nn/image.h"
#include "lib/nn/kernels.h"

#define UNIT_EPS 1e-6f          /* of the public code's (LAM) mean square */

/* A vector of n weights, or none. */
static size_t transformer_declare(struct params *ps, const char *at,
                                  const char *name, size_t n,
                                  enum param_init init, float gain)
{
    char buf[120];

    if (!name)
        return NN_NONE;
    return params_add(ps, nn_name(buf, "%s%s", at, name), 1, &n, init, gain);
}

void transformer_init(struct transformer *t, struct params *ps, const char *at,
                      const struct transformer_kind *kind, size_t width,
                      size_t heads)
{
    const size_t E = width, hidden = kind->widen * E;
    char name[120];

    *t = (struct transformer){.kind = *kind, .ps = ps, .width = E,
                              .dim = E / heads};
    layer_norm_init(&t->norm1, ps, nn_name(name, "%s%s", at, kind->norm1), E,
                    kind->eps1);
    for (int i = 0; i < 3 && kind->in[i]; i++)
        linear_init(&t->in[i], ps, nn_name(name, "%s%s", at, kind->in[i]), E,
                    kind->in[1] ? E : 3 * E);
    for (int i = 0; i < 2; i++)
        t->unit[i] = transformer_declare(ps, at, kind->unit[i], t->dim,
                                         PARAM_ONE, 1);
    if (!kind->out)
        return;
    linear_init(&t->out, ps, nn_name(name, "%s%s", at, kind->out), E, E);
    t->scale1 = transformer_declare(ps, at, kind->scale1, E, PARAM_CONSTANT,
                                    0.1f);
    layer_norm_init(&t->norm2, ps, kind->norm2 ? nn_name(name, "%s%s", at,
                                                         kind->norm2) : NULL,
                    E, kind->eps2);
    linear_init(&t->grow, ps, nn_name(name, "%s%s", at, kind->grow), E, hidden);
    linear_init(&t->shrink, ps, nn_name(name, "%s%s", at, kind->shrink), hidden,
                E);
    t->scale2 = transformer_declare(ps, at, kind->scale2, E, PARAM_CONSTANT,
                                    0.1f);
}

void transformer_plan(struct transformer *t, struct nn_plan *p, size_t rows)
{
    const size_t E = t->width, hidden = t->grow.out;
    struct conv *last[2] = {&t->out, &t->shrink};
    const size_t gamma[2] = {t->scale1, t->scale2};

    t->rows = rows;
    t->learns = nn_plan_backward(p);
    for (int i = 0; i < 3 && t->kind.in[i]; i++)
        linear_plan(&t->in[i], p, rows);
    if (!t->kind.out)
        return;
    for (int i = 0; i < 2; i++) {
        last[i]->add = !t->learns;
        last[i]->gamma = t->learns ? NN_NONE : gamma[i];
    }
    t->grow.act = t->learns ? ACT_NONE : t->kind.act;
    linear_plan(&t->out, p, rows);
    linear_plan(&t->grow, p, rows);
    linear_plan(&t->shrink, p, rows);
    if (!t->learns)
        return;
    float **const map[] = {&t->mid, &t->n1, &t->n2, &t->att, &t->p, &t->f2};
    for (size_t i = 0; i < sizeof map / sizeof *map; i++)
        *map[i] = nn_plan_map(p, rows * E);
    t->qkv = nn_plan_map(p, rows * 3 * E);
    t->f1 = nn_plan_map(p, rows * hidden);
    t->g = nn_plan_map(p, rows * hidden);
    t->stat1 = nn_plan_map(p, 2 * rows);
    t->stat2 = nn_plan_map(p, 2 * rows);
}

void transformer_use(struct transformer *t, float *x, float *normed, float *qkv,
                     float *wide)
{
    t->x = t->mid = x;
    t->n1 = t->att = t->n2 = normed;
    t->qkv = qkv;
    t->f1 = t->g = wide;
}

/* ---- forward ------------------------------------------------------------ */

/* A row's heads over their root mean square, times weight. */
PARALLEL(transformer_unit_part, i, float *, x, const float *, weight,
         size_t, dim, size_t, width)
{
    for (float *at = x + i * width; at < x + (i + 1) * width; at += dim) {
        float sum = 0;

        for (size_t k = 0; k < dim; k++)
            sum += at[k] * at[k];
        const float over = 1 / sqrtf(sum / (float)dim + UNIT_EPS);

        for (size_t k = 0; k < dim; k++)
            at[k] = at[k] * over * weight[k];
    }
}

/* y = x + gamma p */
static void transformer_residual(float *y, const float *x, const float *p,
                                 size_t gamma, const struct transformer *t)
{
    nn_kernels()->channel_scale(y, p, param_w(t->ps, gamma), NULL, t->rows,
                                t->width);
    image_add(y, x, t->rows * t->width);
}

void transformer_attend(struct transformer *t, size_t part)
{
    layer_norm_forward(t->n1, t->stat1, t->x, &t->norm1, t->rows);
    for (size_t i = 0; i < 3 && t->kind.in[i]; i++) {
        float *out = t->qkv + i * part;

        conv_forward(out, t->n1, &t->in[i]);
        if (i < 2 && t->kind.unit[i])
            parallel_each(transformer_unit_part, t->rows, 64, out,
                          param_w(t->ps, t->unit[i]), t->dim, t->width);
    }
}

void transformer_feed(float *next, struct transformer *t)
{
    if (!t->kind.out)
        return;
    conv_forward(t->learns ? t->p : t->x, t->att, &t->out);
    if (t->learns)
        transformer_residual(t->mid, t->x, t->p, t->scale1, t);
    layer_norm_forward(t->n2, t->stat2, t->mid, &t->norm2, t->rows);
    conv_forward(t->f1, t->n2, &t->grow);
    if (t->learns)
        act_forward(t->g, t->f1, t->kind.act, t->rows * t->grow.out);
    conv_forward(t->learns ? t->f2 : t->x, t->g, &t->shrink);
    if (t->learns)
        transformer_residual(next, t->mid, t->f2, t->scale2, t);
}

void transformer_forward(float *next, struct transformer *t,
                         struct attention *a)
{
    transformer_attend(t, a->part);
    attention_forward(t->att, t->qkv, a);
    transformer_feed(next, t);
}

/* ---- and back ----------------------------------------------------------- */

void transformer_plan_gradient(struct transformer_gradient *d,
                               struct nn_plan *p, const struct transformer *t)
{
    d->dx = nn_plan_floats(p, t->rows * t->width);
    d->ds = nn_plan_floats(p, t->rows * t->width);
    d->dn = nn_plan_floats(p, t->rows * t->width);
    d->wide = nn_plan_floats(p, 2 * t->rows * t->grow.out);
    d->sums = nn_plan_floats(p, NN_SUMS * 2 * t->width);
}

void transformer_norm_backward(struct transformer_gradient *d, const float *dy,
                               const float *x, const float *stat,
                               const struct layer_norm *norm, size_t rows)
{
    layer_norm_backward(d->ds, d->sums, dy, x, stat, norm, rows);
    image_add(d->dx, d->ds, rows * norm->channels);
}

/* In the forward pass: y = x + gamma p.  ds = gamma dx, dgamma += dx p. */
static void transformer_residual_backward(struct transformer_gradient *d,
                                          const float *p, size_t gamma,
                                          const struct transformer *t)
{
    float *dgamma = param_g(t->ps, gamma);

    nn_kernels()->channel_dot(d->sums, d->dx, p, t->rows, t->width);
    for (size_t e = 0; e < t->width; e++)
        dgamma[e] += d->sums[e];
    nn_kernels()->channel_scale(d->ds, d->dx, param_w(t->ps, gamma), NULL,
                                t->rows, t->width);
}

void transformer_backward(struct transformer_gradient *d,
                          struct transformer *t, struct attention *a)
{
    const size_t hidden = t->rows * t->grow.out;
    float *wide = d->wide, *dqkv = wide + hidden;

    transformer_residual_backward(d, t->f2, t->scale2, t);
    conv_backward(wide, d->ds, t->f2, t->g, &t->shrink);
    act_backward(wide, wide, t->f1, t->kind.act, hidden);
    conv_backward(d->dn, wide, t->f1, t->n2, &t->grow);
    transformer_norm_backward(d, d->dn, t->mid, t->stat2, &t->norm2, t->rows);
    transformer_residual_backward(d, t->p, t->scale1, t);
    conv_backward(d->dn, d->ds, t->p, t->att, &t->out);
    attention_backward(dqkv, d->dn, t->qkv, a);
    conv_backward(d->dn, dqkv, t->qkv, t->n1, t->in);
    transformer_norm_backward(d, d->dn, t->x, t->stat1, &t->norm1, t->rows);
}
