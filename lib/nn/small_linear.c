/* Linear layers of at most 16 rows, every sum in double precision. */
#include "lib/nn/small_linear.h"

#include <string.h>

#include "lib/base/parallel.h"
#include "lib/nn/conv.h"
#include "lib/nn/kernels.h"

#define ROWS 16

bool small_linear_wanted(const struct conv *c)
{
    return c->kernel == 1 && c->stride == 1 &&
           c->batch * c->h * c->w <= ROWS && c->act <= ACT_LRELU;
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

PARALLEL(small_linear_forward_part, o, const struct nn_kernels *, k,
         const struct small_linear *, t, const float *, in, float *, out,
         const struct conv *, c, size_t, rows, size_t, K, size_t, N)
{
    for (size_t r = 0; r < rows; r++) {
        double sum = k->dot(t->w + o * K, in + r * K, K) + (double)t->bias[o];
        float *to = out + r * N + o;

        *to = (float)(c->add ? sum + (double)*to : sum);
    }
}

void small_linear_forward(float *out, const float *in,
                          const struct small_linear *t)
{
    const struct nn_kernels *k = nn_kernels();
    const struct conv *c = t->c;
    size_t rows = c->batch * c->h * c->w, K = c->in_data, N = c->out;

    parallel_each(small_linear_forward_part, N, N * K > 65536 ? 1 : N, k, t, in,
                  out, c, rows, K, N);
    if (c->act != ACT_NONE)
        act_forward(out, out, c->act, rows * N);
}
