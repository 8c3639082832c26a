/* Linear layers of at most 16 rows, every sum in double precision. */
#include "lib/nn/small_linear.h"

#include <string.h>

#include "lib/nn/conv.h"
#include "lib/nn/kernels.h"

#define ROWS 16

bool small_linear_wanted(const struct conv *c)
{
    enum nn_type type = nn_plan_type(c->plan);

    return (type == NN_F32 || type == NN_FAST) && c->kernel == 1 &&
           c->stride == 1 && c->batch * c->h * c->w <= ROWS &&
           c->act <= ACT_LRELU;
}

void small_linear_plan(struct small_linear *t, const struct conv *c,
                       struct nn_plan *p)
{
    t->c = c;
    t->w = nn_plan_floats(p, c->out * c->in_data);
    t->bias = nn_plan_floats(p, c->out);
}

void small_linear_update(struct small_linear *t, const float *w,
                         const float *bias)
{
    memcpy(t->w, w, t->c->out * t->c->in_data * sizeof *w);
    memcpy(t->bias, bias, t->c->out * sizeof *bias);
}

void small_linear_forward(float *out, const float *in,
                          const struct small_linear *t)
{
    const struct nn_kernels *k = nn_kernels();
    const struct conv *c = t->c;
    size_t rows = c->batch * c->h * c->w, K = c->in_data, N = c->out;
#pragma omp parallel for schedule(static) if (N * K > 65536)
    for (size_t o = 0; o < N; o++)
        for (size_t r = 0; r < rows; r++) {
            double sum = k->dot(t->w + o * K, in + r * K, K) +
                         (double)t->bias[o];
            float *to = out + r * N + o;

            *to = (float)(c->add ? sum + (double)*to : sum);
        }
    if (c->act != ACT_NONE)
        act_forward(out, out, c->act, rows * N);
}
