/* Batch normalisation (Ioffe and Szegedy 2015) and layer normalisation (Ba et
 * al. 2016), forward and backward, sums in a fixed number of parts. */
#include "lib/nn/norm.h"

#include <math.h>
#include <string.h>

#include "lib/base/parallel.h"
#include "lib/nn/conv.h"
#include "lib/nn/kernels.h"

#define PERIOD 128
#define MOMENTUM 0.1f

void batch_norm_init(struct batch_norm *n, struct params *ps,
                     const char *name, size_t channels, float eps)
{
    char buf[120];

    memset(n, 0, sizeof *n);
    n->ps = ps;
    n->channels = channels;
    n->eps = eps;
    n->weight = params_add(ps, nn_name(buf, "%s.weight", name), 1, &channels,
                           PARAM_ONE, 1);
    n->bias = params_add(ps, nn_name(buf, "%s.bias", name), 1, &channels,
                         PARAM_ZERO, 0);
    n->mean = params_add(ps, nn_name(buf, "%s.running_mean", name), 1,
                         &channels, PARAM_ZERO, 0);
    n->var = params_add(ps, nn_name(buf, "%s.running_var", name), 1,
                        &channels, PARAM_ONE, 1);
    ps->tensor[n->mean].frozen = ps->tensor[n->var].frozen = true;
}

void batch_norm_plan(struct batch_norm *n, struct nn_plan *p, size_t rows)
{
    size_t C = n->channels;

    n->plan = p;
    n->rows = rows;
    n->period = C * ((PERIOD + C - 1) / C);
    n->batch_mean = nn_plan_floats(p, C);
    n->rstd = nn_plan_floats(p, C);
    n->scale = nn_plan_floats(p, n->period);
    n->shift = nn_plan_floats(p, n->period);
    n->coef = nn_plan_floats(p, 4 * n->period);
    n->part = nn_plan_floats(p, NN_SUMS * 2 * C);
}

/* Parts that sums over rows are made in: by their number alone. */
static size_t norm_part_count(size_t rows)
{
    return rows < 8 * NN_SUMS ? 1 : NN_SUMS;
}

/* a (period) holds C values: repeat them. */
static void norm_repeat_channels(float *a, size_t C, size_t period)
{
    for (size_t i = C; i < period; i++)
        a[i] = a[i - C];
}

PARALLEL(norm_batch_statistics_part, i, struct batch_norm *, n,
         const float *, x, size_t, rows, size_t, parts, size_t, C)
{
    size_t r0 = i * rows / parts, r1 = (i + 1) * rows / parts;

    /* any value of the channel serves as origin */
    nn_kernels()->norm_sums(n->part + i * 2 * C, x + r0 * C, x, r1 - r0, C);
}

/* Statistics of x, and the running ones moved towards them. */
static void norm_batch_statistics(struct batch_norm *n, const float *x)
{
    size_t C = n->channels, rows = n->rows, parts = norm_part_count(rows);
    float *run_mean = param_w(n->ps, n->mean);
    float *run_var = param_w(n->ps, n->var);

    parallel_each(norm_batch_statistics_part, parts, 1, n, x, rows, parts, C);
    for (size_t c = 0; c < C; c++) {
        double s = 0, q = 0, count = (double)rows;

        for (size_t i = 0; i < parts; i++) {
            s += (double)n->part[i * 2 * C + c];
            q += (double)n->part[i * 2 * C + C + c];
        }
        double mean = s / count, var = q / count - mean * mean;
        if (var < 0)
            var = 0;
        n->batch_mean[c] = (float)((double)x[c] + mean);
        n->rstd[c] = (float)(1 / sqrt(var + (double)n->eps));
        double unbiased = rows > 1 ? var * count / (count - 1) : var;
        run_mean[c] += MOMENTUM * (n->batch_mean[c] - run_mean[c]);
        run_var[c] += MOMENTUM * ((float)unbiased - run_var[c]);
    }
}

/* Rows [r0,r1) of chunk i; chunks begin at whole periods. */
static size_t norm_chunk_rows(const struct batch_norm *n)
{
    size_t rep = n->period / n->channels;
    size_t rows = 8192 / n->period * rep;

    return rows ? rows : rep;
}

/* One chunk. */
PARALLEL(batch_norm_forward_part, part, struct batch_norm *, n, float *, y,
         const float *, x, const float *, res, size_t, step, size_t, C)
{
    size_t r = part * step;
    size_t m = n->rows - r < step ? n->rows - r : step;

    nn_kernels()->norm_apply(y + r * C, x + r * C, res ? res + r * C : NULL,
                             n->scale, n->shift, (int)n->act, n->period, m * C);
}

void batch_norm_forward(float *y, const float *x, const float *res,
                        struct batch_norm *n)
{
    size_t C = n->channels, step = norm_chunk_rows(n);
    const float *w = param_w(n->ps, n->weight), *b = param_w(n->ps, n->bias);

    if (n->plan->opt.mode == NN_TRAIN) {
        norm_batch_statistics(n, x);
    } else {
        for (size_t c = 0; c < C; c++) {
            n->batch_mean[c] = param_w(n->ps, n->mean)[c];
            n->rstd[c] = 1 / sqrtf(param_w(n->ps, n->var)[c] + n->eps);
        }
    }
    for (size_t c = 0; c < C; c++) {
        n->scale[c] = w[c] * n->rstd[c];
        n->shift[c] = b[c] - n->batch_mean[c] * n->scale[c];
    }
    norm_repeat_channels(n->scale, C, n->period);
    norm_repeat_channels(n->shift, C, n->period);

    parallel_each(batch_norm_forward_part, (n->rows + step - 1) / step, 1, n, y,
                  x, res, step, C);
}

/* From the parts' sums: the gradients of weight and bias, and what
 * norm_backward_apply makes dx of. */
static void norm_backward_coefficients(struct batch_norm *n, size_t parts)
{
    const size_t C = n->channels, P = n->period;
    const bool learns = !n->ps->tensor[n->weight].frozen;
    float *coef = n->coef;

    for (size_t c = 0; c < C; c++) {
        double s = 0, q = 0, count = (double)n->rows;
        double rstd = (double)n->rstd[c], a = (double)n->scale[c];

        for (size_t i = 0; i < parts; i++) {
            s += (double)n->part[i * 2 * C + c];
            q += (double)n->part[i * 2 * C + C + c];
        }
        if (learns) {
            param_g(n->ps, n->weight)[c] += (float)(q * rstd);
            param_g(n->ps, n->bias)[c] += (float)s;
        }
        coef[c] = (float)a;
        coef[P + c] = (float)(-a * rstd * rstd * q / count);
        coef[2 * P + c] = (float)(-a * s / count);
        coef[3 * P + c] = n->batch_mean[c];
    }
}

PARALLEL(batch_norm_backward_part, i, struct batch_norm *, n, float *, dx,
         const float *, dy, const float *, x, size_t, rows, size_t, parts,
         size_t, C, bool, train)
{
    size_t r0 = i * rows / parts, r1 = (i + 1) * rows / parts;

    nn_kernels()->norm_backward_sums(n->part + i * 2 * C, dx + r0 * C,
                                     dy + r0 * C, x + r0 * C, n->scale,
                                     n->shift, n->batch_mean, (int)n->act,
                                     !train, r1 - r0, C);
}

/* One chunk. */
PARALLEL(batch_norm_data_part, part, float *, dx, const float *, x,
         struct batch_norm *, n, size_t, rows, size_t, step, size_t, C,
         size_t, P)
{
    size_t r = part * step;
    size_t m = rows - r < step ? rows - r : step;

    nn_kernels()->norm_backward_apply(dx + r * C, dx + r * C, x + r * C,
                                      n->coef, P, m * C);
}

/* In the forward pass this was, with hat = (x - mean) rstd:
 *   y = act(hat weight + bias)                                              */
void batch_norm_backward(float *dx, const float *dy, const float *x,
                         struct batch_norm *n)
{
    size_t C = n->channels, rows = n->rows, parts = norm_part_count(rows);
    size_t P = n->period, step = norm_chunk_rows(n);
    bool train = n->plan->opt.mode == NN_TRAIN;

    parallel_each(batch_norm_backward_part, parts, 1, n, dx, dy, x, rows, parts,
                  C, train);
    norm_backward_coefficients(n, parts);
    if (!train)
        return;
    for (size_t i = 0; i < 4; i++)
        norm_repeat_channels(n->coef + i * P, C, P);

    parallel_each(batch_norm_data_part, (rows + step - 1) / step, 1, dx, x, n,
                  rows, step, C, P);
}

#define LN_ROWS 32

void layer_norm_init(struct layer_norm *n, struct params *ps,
                     const char *name, size_t channels, float eps)
{
    char buf[120];

    *n = (struct layer_norm){.ps = ps, .weight = NN_NONE, .bias = NN_NONE,
                             .channels = channels, .eps = eps};
    if (!name)
        return;
    n->weight = params_add(ps, nn_name(buf, "%s.weight", name), 1, &channels,
                           PARAM_ONE, 1);
    n->bias = params_add(ps, nn_name(buf, "%s.bias", name), 1, &channels,
                         PARAM_ZERO, 0);
}

/* One chunk. */
PARALLEL(layer_norm_forward_part, part, float *, y, float *, stat,
         const float *, x, const struct layer_norm *, n, size_t, rows)
{
    const bool plain = n->weight == NN_NONE;
    size_t r = part * LN_ROWS, C = n->channels;
    size_t m = rows - r < LN_ROWS ? rows - r : LN_ROWS;

    nn_kernels()->layer_norm_forward(y + r * C, stat ? stat + r : NULL,
                                     stat ? stat + rows + r : NULL, x + r * C,
                                     plain ? NULL : param_w(n->ps, n->weight),
                                     plain ? NULL : param_w(n->ps, n->bias),
                                     n->eps, m, C);
}

void layer_norm_forward(float *y, float *stat, const float *x,
                        const struct layer_norm *n, size_t rows)
{
    parallel_each(layer_norm_forward_part, (rows + LN_ROWS - 1) / LN_ROWS, 1,
                  y, stat, x, n, rows);
}

PARALLEL(layer_norm_backward_part, i, float *, dx, float *, part,
         const float *, dy, const float *, x, const float *, stat,
         const struct layer_norm *, n, size_t, rows, size_t, parts)
{
    size_t r = i * rows / parts, m = (i + 1) * rows / parts - r;
    size_t C = n->channels;

    nn_kernels()->layer_norm_backward(dx + r * C, part + i * 2 * C, dy + r * C,
                                      x + r * C, stat + r, stat + rows + r,
                                      param_w(n->ps, n->weight), m, C);
}

void layer_norm_backward(float *dx, float *part, const float *dy,
                         const float *x, const float *stat,
                         const struct layer_norm *n, size_t rows)
{
    float *dweight = param_g(n->ps, n->weight);
    float *dbias = param_g(n->ps, n->bias);
    size_t parts = norm_part_count(rows), C = n->channels;

    parallel_each(layer_norm_backward_part, parts, 1, dx, part, dy, x, stat, n,
                  rows, parts);
    for (size_t i = 0; i < parts; i++)
        for (size_t c = 0; c < C; c++) {
            dweight[c] += part[i * 2 * C + c];
            dbias[c] += part[i * 2 * C + C + c];
        }
}
