/* Adam (Kingma and Ba 2015) with a limit on the gradient's norm and an
 * exponential average of the weights, which is what is saved. */
#include "lib/lab/train/adam.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"

int adam_init(struct adam *a, const struct params *ps, float clip,
              float decay, struct error *err)
{
    memset(a, 0, sizeof *a);
    a->beta1 = 0.9f;
    a->beta2 = 0.999f;
    a->eps = 1e-8f;
    a->clip = clip;
    a->decay = decay;
    a->total = ps->total;
    a->m = calloc(a->total + 1, sizeof *a->m);
    a->v = calloc(a->total + 1, sizeof *a->v);
    if (decay > 0)
        a->average = malloc((a->total + 1) * sizeof *a->average);
    if (!a->m || !a->v || (decay > 0 && !a->average)) {
        adam_release(a);
        return error_set(err, EX_OSERR, "out of memory (%zu weights)",
                         ps->total);
    }
    if (a->average)
        memcpy(a->average, ps->w, a->total * sizeof *a->average);
    return 0;
}

void adam_release(struct adam *a)
{
    free(a->m);
    free(a->v);
    free(a->average);
    memset(a, 0, sizeof *a);
}

/* Sum of squares. */
static double adam_square(const float *g, size_t n)
{
    double sum = 0;

#pragma omp simd reduction(+ : sum)
    for (size_t i = 0; i < n; i++)
        sum += (double)g[i] * g[i];
    return sum;
}

double adam_norm(const struct params *ps)
{
    double sum = 0;

    for (size_t t = 0; t < ps->count; t++)
        if (!ps->tensor[t].frozen)
            sum += adam_square(param_g(ps, t), ps->tensor[t].count);
    return sqrt(sum);
}

size_t adam_first_bad(const struct params *ps)
{
    for (size_t t = 0; t < ps->count; t++) {
        const float *g = param_g(ps, t);

        for (size_t i = 0; !ps->tensor[t].frozen && i < ps->tensor[t].count;
             i++)
            if (!isfinite(g[i]))
                return t;
    }
    return (size_t)-1;
}

/* One tensor: m and v move, then the weights. */
static void adam_update_tensor(const struct adam *a, float *restrict w,
                               float *restrict m, float *restrict v,
                               const float *restrict g, size_t n, float scale,
                               float rate, float root2)
{
    float b1 = a->beta1, b2 = a->beta2, eps = a->eps;

#pragma omp simd
    for (size_t i = 0; i < n; i++) {
        float d = g[i] * scale;
        m[i] = b1 * m[i] + (1 - b1) * d;
        v[i] = b2 * v[i] + (1 - b2) * d * d;
        w[i] -= rate * m[i] / (sqrtf(v[i]) * root2 + eps);
    }
}

PARALLEL(adam_move_average_part, k, const struct params *, ps, struct adam *, a,
         float, keep)
{
    const struct param *p = &ps->tensor[k];
    float *restrict e = a->average + p->offset;
    const float *restrict w = ps->w + p->offset;

    if (p->frozen) { /* running statistics are averages already */
        memcpy(e, w, p->count * sizeof *e);
        return;
    }
#pragma omp simd
    for (size_t i = 0; i < p->count; i++)
        e[i] = keep * e[i] + (1 - keep) * w[i];
}

/* One step of the exponential average, faster in the first steps. */
static void adam_move_average(struct adam *a, const struct params *ps)
{
    double t = (double)a->step;
    float keep = (float)fmin(a->decay, (1 + t) / (10 + t));

    parallel_each(adam_move_average_part, ps->count, 1, ps, a, keep);
}

PARALLEL(adam_update_part, k, struct params *, ps, struct adam *, a,
         double, scale, float, step, float, root2)
{
    const struct param *p = &ps->tensor[k];
    if (!p->frozen)
        adam_update_tensor(a, ps->w + p->offset, a->m + p->offset,
                           a->v + p->offset, ps->g + p->offset, p->count,
                           (float)scale, step, root2);
}

void adam_update(struct adam *a, struct params *ps, double rate, double norm)
{
    double t = (double)++a->step;
    double scale = a->clip > 0 && norm > a->clip ? a->clip / norm : 1;

    /* m / (1 - b1^t) over sqrt(v / (1 - b2^t)) + eps */
    float step = (float)(rate / (1 - pow(a->beta1, t)));
    float root2 = (float)(1 / sqrt(1 - pow(a->beta2, t)));

    parallel_each(adam_update_part, ps->count, 1, ps, a, scale, step, root2);
    if (a->average)
        adam_move_average(a, ps);
}
