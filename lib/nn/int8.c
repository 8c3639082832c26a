/* 8-bit convolutions: weights quantised for each output channel once, inputs
 * by the range of the picture at hand. */
#include "lib/nn/int8.h"

#include <math.h>
#include <string.h>

#include "lib/base/parallel.h"
#include "lib/nn/conv.h"
#include "lib/nn/kernels.h"

#define CHUNK 16384

size_t int8_input_size(const struct int8 *q, const struct conv *c)
{
    return c->batch * q->h * q->w * c->in_data;
}

void int8_plan(struct int8 *q, const struct conv *c, struct nn_plan *p)
{
    q->weight = nn_plan_bytes(p, c->out * c->in_data * c->kernel * c->kernel);
    q->step = nn_plan_floats(p, c->out);
    q->sum = nn_plan_floats(p, c->out);
    q->scale = nn_plan_floats(p, c->out);
    q->bias = nn_plan_floats(p, c->out);
}

void int8_update(struct int8 *q, const struct conv *c, const float *w)
{
    const float range = 127;
    const size_t n = c->in_data * c->kernel * c->kernel;

    for (size_t o = 0; o < c->out; o++, w += n) {
        int8_t *to = q->weight + o * n;
        float max = 0, sum = 0;

        for (size_t i = 0; i < n; i++)
            max = fmaxf(max, fabsf(w[i]));
        q->step[o] = max > 0 ? max / range : 1;
        for (size_t i = 0; i < n; i++) {
            float x = rintf(w[i] / q->step[o]);

            to[i] = (int8_t)x;
            sum += x;
        }
        q->sum[o] = sum;
    }
}

#define RANGES 64               /* parts whose least and greatest are taken */

/* Those of part k of n numbers. */
PARALLEL(int8_range_part, k, float *, lo, float *, hi, const float *, in,
         size_t, n)
{
    const size_t at = n * k / RANGES, end = n * (k + 1) / RANGES;

    lo[k] = hi[k] = 0;
    nn_kernels()->range(&lo[k], &hi[k], in + at, end - at);
}

/* Least and greatest of 0 and the input. */
static void int8_range(float *lo, float *hi, const float *in, size_t n)
{
    float least[RANGES], greatest[RANGES];

    parallel_each(int8_range_part, RANGES, 1 + CHUNK / (n / RANGES + 1), least,
                  greatest, in, n);
    *lo = *hi = 0;
    for (size_t k = 0; k < RANGES; k++) {
        *lo = fminf(*lo, least[k]);
        *hi = fmaxf(*hi, greatest[k]);
    }
}

/* Row r of the padded pictures, from row y - top of its picture if that has
 * it. */
PARALLEL(int8_quantise_row, r, uint8_t *, bytes, const float *, in,
         const struct int8 *, q, const struct conv *, c, float, step,
         float, zero)
{
    const size_t C = c->in_data, n = c->w * C, y = r % q->h;
    const int z = (int)zero;
    uint8_t *to = bytes + r * q->w * C;

    if (y < q->top || y >= q->top + c->h) {
        memset(to, z, q->w * C);
        return;
    }
    memset(to, z, q->left * C);
    nn_kernels()->quantise(to + q->left * C,
                           in + (r / q->h * c->h + y - q->top) * n, 1 / step,
                           zero, n);
    memset(to + q->left * C + n, z, (q->w - q->left - c->w) * C);
}

const uint8_t *int8_input(struct int8 *q, const struct conv *c,
                          const float *in, const float *bias)
{
    uint8_t *bytes = (uint8_t *)c->plan->scratch + q->at;
    float lo, hi;

    int8_range(&lo, &hi, in, c->batch * c->h * c->w * c->in_data);
    const float step = hi > lo ? (hi - lo) / 255 : 1;
    const float zero = rintf(-lo / step);

    parallel_each(int8_quantise_row, c->batch * q->h, 1, bytes, in, q, c, step,
                  zero);
    for (size_t o = 0; o < c->out; o++) {
        q->scale[o] = step * q->step[o];
        q->bias[o] = bias[o] / q->scale[o] - zero * q->sum[o];
    }
    return bytes;
}
