/* Resizing by a sparse matrix per axis, and its transpose for the backward:
 * bilinear, antialiased, Keys' bicubic, and means of areas or of pixels. */
#include "lib/nn/rescale.h"

#include <math.h>
#include <string.h>

#include "lib/base/parallel.h"
#include "lib/nn/kernels.h"

#define RESCALE_TAPS 1024       /* shrinks by 500 times and more would have more */

/* Which inputs output o reads: indices may repeat and lie outside. */
struct rescale_taps {
    int n;
    long index[RESCALE_TAPS];
    double weight[RESCALE_TAPS];
};

/* Keys' cubic convolution kernel at distance t. */
static double rescale_cubic(double A, double t)
{
    double x = fabs(t);

    if (x <= 1)
        return ((A + 2) * x - (A + 3)) * x * x + 1;
    return x < 2 ? ((A * x - 5 * A) * x + 8 * A) * x - 4 * A : 0;
}

/* How much of input j output pixel o covers, of inputs. */
static double rescale_overlap(long j, double scale, size_t o)
{
    const double from = scale * (double)o, to = from + scale;

    return fmin((double)j + 1, to) - fmax((double)j, from);
}

/* A triangle or cubic as wide as an output pixel, or that pixel itself, cut at
 * the borders and normalised. */
static void rescale_antialias(struct rescale_taps *t, enum rescale_mode mode,
                              size_t n, double scale, size_t o)
{
    const double unit = scale > 1 ? scale : 1;
    double support = mode == RESCALE_BICUBIC_ANTIALIAS ? 2 * unit : unit;
    double c = scale * ((double)o + 0.5), sum = 0;
    long lo = (long)(c - support + 0.5), hi = (long)(c + support + 0.5);

    lo = lo < 0 ? 0 : lo;
    hi = hi > (long)n ? (long)n : hi;
    for (long j = lo; j < hi && t->n < RESCALE_TAPS; j++) {
        const double at = ((double)j - c + 0.5) / unit;
        double w = mode == RESCALE_AREA ? rescale_overlap(j, scale, o)
                 : mode == RESCALE_ANTIALIAS ? 1 - fabs(at)
                                             : rescale_cubic(-0.5, at);

        if (mode != RESCALE_BICUBIC_ANTIALIAS && w <= 0)
            continue;
        t->index[t->n] = j;
        t->weight[t->n++] = w;
        sum += w;
    }
    for (int i = 0; i < t->n; i++)
        t->weight[i] /= sum;
}

/* The whole inputs of which output o covers some, alike. */
static void rescale_touch(struct rescale_taps *t, size_t n, size_t m, size_t o)
{
    const size_t from = o * n / m, to = ((o + 1) * n + m - 1) / m;

    for (size_t j = from; j < to && t->n < RESCALE_TAPS; j++) {
        t->index[t->n] = (long)j;
        t->weight[t->n++] = 1 / (double)(to - from);
    }
}

/* What output o of m reads of n inputs, which lie `scale` apart. */
static void rescale_find_taps(struct rescale_taps *t, enum rescale_mode mode,
                              size_t n, size_t m, double scale, size_t o)
{
    t->n = 0;
    if (mode == RESCALE_TOUCHED) {
        rescale_touch(t, n, m, o);
        return;
    }
    if (mode == RESCALE_ANTIALIAS || mode == RESCALE_BICUBIC_ANTIALIAS ||
        mode == RESCALE_AREA) {
        rescale_antialias(t, mode, n, scale, o);
        return;
    }
    double src = ((double)o + 0.5) * scale - 0.5;
    if (mode == RESCALE_ALIGNED)
        src = m > 1 ? (double)o * (double)(n - 1) / (double)(m - 1) : 0;
    if (mode != RESCALE_BICUBIC && src < 0)
        src = 0;
    long i0 = (long)floor(src);
    double f = src - (double)i0;
    int lo = mode == RESCALE_BICUBIC ? -1 : 0;
    int hi = mode == RESCALE_BICUBIC ? 2 : 1;
    for (int k = lo; k <= hi; k++) {
        double w = mode == RESCALE_BICUBIC ? rescale_cubic(-0.75, f - k)
                   : k ? f : 1 - f;

        t->index[t->n] = i0 + k;
        t->weight[t->n++] = w;
    }
}

/* i, within [0, n). */
static long rescale_clamp(long i, size_t n)
{
    return i < 0 ? 0 : i >= (long)n ? (long)n - 1 : i;
}

/* The transposed lists, output order ascending. */
static void rescale_transpose(struct rescale_axis *a)
{
    for (size_t o = 0; o < a->out; o++)
        for (size_t k = 0; k < a->taps; k++)
            if (a->weight[o * a->taps + k] != 0)
                a->start[a->first[o] + (int32_t)k + 1]++;
    for (size_t i = 0; i < a->in; i++)
        a->start[i + 1] += a->start[i];
    for (size_t i = 0; i < a->in; i++) {
        int32_t at = a->start[i];

        for (size_t o = 0; o < a->out && at < a->start[i + 1]; o++) {
            long k = (long)i - a->first[o];

            if (k < 0 || k >= (long)a->taps)
                continue;
            float w = a->weight[o * a->taps + (size_t)k];
            if (w != 0) {
                a->from[at] = (int32_t)o;
                a->tweight[at++] = w;
            }
        }
    }
}

/* The sparse matrix of one axis and its transpose. */
static void rescale_plan_axis(struct rescale_axis *a, struct nn_plan *p,
                              enum rescale_mode mode, size_t in, size_t out,
                              double scale)
{
    struct rescale_taps t;

    *a = (struct rescale_axis){ .in = in, .out = out, .taps = 1 };
    for (size_t o = 0; o < out; o++) {
        long lo = (long)in, hi = 0;

        rescale_find_taps(&t, mode, in, out, scale, o);
        for (int i = 0; i < t.n; i++) {
            long j = rescale_clamp(t.index[i], in);

            lo = j < lo ? j : lo;
            hi = j > hi ? j : hi;
        }
        if ((size_t)(hi - lo + 1) > a->taps)
            a->taps = (size_t)(hi - lo + 1);
    }
    a->first = nn_plan_bytes(p, out * sizeof *a->first);
    a->weight = nn_plan_floats(p, out * a->taps);
    a->start = nn_plan_bytes(p, (in + 1) * sizeof *a->start);
    a->from = nn_plan_bytes(p, out * a->taps * sizeof *a->from);
    a->tweight = nn_plan_floats(p, out * a->taps);
    if (p->err.code)
        return;
    for (size_t o = 0; o < out; o++) {
        long lo = (long)in;

        rescale_find_taps(&t, mode, in, out, scale, o);
        for (int i = 0; i < t.n; i++)
            lo = rescale_clamp(t.index[i], in) < lo ? rescale_clamp(t.index[i],
                                                                    in) : lo;
        if (lo + (long)a->taps > (long)in)
            lo = (long)in - (long)a->taps;
        a->first[o] = (int32_t)lo;
        for (int i = 0; i < t.n; i++)
            a->weight[o * a->taps +
                      (size_t)(rescale_clamp(t.index[i], in) - lo)] +=
                (float)t.weight[i];
    }
    rescale_transpose(a);
}

/* What both ways of planning share: sizes, and a scratch row per thread. */
static void rescale_plan_rest(struct rescale *r, struct nn_plan *p,
                              size_t batch, size_t C)
{
    r->batch = batch;
    r->C = C;
    r->plan = p;
    size_t wide = r->x.in > r->x.out ? r->x.in : r->x.out;
    r->line = (wide * C + 15) / 16 * 16;
    nn_plan_scratch(p, r->line * sizeof(float) *
                           (size_t)parallel_width());
}

void rescale_plan(struct rescale *r, struct nn_plan *p, enum rescale_mode mode,
                  size_t batch, size_t h, size_t w, size_t oh, size_t ow,
                  size_t C)
{
    rescale_plan_axis(&r->y, p, mode, h, oh, (double)h / (double)oh);
    rescale_plan_axis(&r->x, p, mode, w, ow, (double)w / (double)ow);
    rescale_plan_rest(r, p, batch, C);
}

void rescale_plan_factor(struct rescale *r, struct nn_plan *p,
                         enum rescale_mode mode, size_t batch, size_t h,
                         size_t w, size_t oh, size_t ow, double factor_y,
                         double factor_x, size_t C)
{
    rescale_plan_axis(&r->y, p, mode, h, oh, 1 / factor_y);
    rescale_plan_axis(&r->x, p, mode, w, ow, 1 / factor_x);
    rescale_plan_rest(r, p, batch, C);
}

/* The calling thread's row in the plan's scratch. */
static float *rescale_thread_line(const struct rescale *r)
{
    return (float *)(void *)r->plan->scratch +
           parallel_slot() * r->line;
}

PARALLEL(rescale_forward_part, at, float *, out, struct rescale *, r,
         const float *, in)
{
    size_t n = at / r->y.out, o = at % r->y.out;

    nn_kernels()->rescale_line(out + at * r->x.out * r->C,
                               rescale_thread_line(r),
                               in + n * r->y.in * r->x.in * r->C, r, o);
}

void rescale_forward(float *out, const float *in, struct rescale *r)
{
    parallel_each(rescale_forward_part, r->batch * r->y.out, 1, out, r, in);
}

PARALLEL(rescale_backward_part, at, float *, din, struct rescale *, r,
         const float *, dout)
{
    size_t n = at / r->y.in, i = at % r->y.in;

    nn_kernels()->rescale_line_backward(din + at * r->x.in * r->C,
                                        rescale_thread_line(r),
                                        dout + n * r->y.out * r->x.out * r->C,
                                        r, i);
}

void rescale_backward(float *din, const float *dout, struct rescale *r)
{
    parallel_each(rescale_backward_part, r->batch * r->y.in, 1, din, r, dout);
}
