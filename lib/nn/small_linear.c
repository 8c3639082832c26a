/* Linear layers of at most 16 rows, every sum in double precision. */
#include "lib/nn/small_linear.h"

#include <string.h>

#include "lib/base/parallel.h"
#include "lib/nn/conv_impl.h"
#include "lib/nn/kernels.h"

#define ROWS 16

bool small_linear_wanted(const struct conv *c)
{
    return c->kernel == 1 && c->stride == 1 &&
           c->batch * c->h * c->w <= ROWS && c->act <= ACT_LRELU;
}

void small_linear_plan(struct conv *c, const struct conv_shape *s)
{
    (void)s;
    c->impl->small_linear.w = nn_plan_floats(c->plan, c->out * c->in_data);
}

void small_linear_update(struct conv *c, const float *w)
{
    memcpy(c->impl->small_linear.w, w, c->out * c->in_data * sizeof *w);
}

PARALLEL(small_linear_forward_part, o, const struct nn_kernels *, k,
         const float *, in, float *, out, const struct conv *, c,
         size_t, rows)
{
    const float *w = c->impl->small_linear.w + o * c->in_data;

    for (size_t r = 0; r < rows; r++) {
        double sum = k->dot(w, in + r * c->in_data, c->in_data) +
                     (double)c->impl->bias[o];
        float *to = out + r * c->out + o;

        *to = (float)(c->add ? sum + (double)*to : sum);
    }
}

void small_linear_forward(float *out, const float *in, struct conv *c)
{
    const size_t rows = c->batch * c->h * c->w, N = c->out;

    parallel_each(small_linear_forward_part, N,
                  N * c->in_data > 65536 ? 1 : N, nn_kernels(), in, out, c,
                  rows);
    if (c->act != ACT_NONE)
        act_forward(out, out, c->act, rows * N);
}
