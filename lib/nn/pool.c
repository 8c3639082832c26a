/* Max pooling over rows, which the kernels take one at a time. */
#include "lib/nn/pool.h"

#include <assert.h>

#include "lib/base/parallel.h"
#include "lib/nn/kernels.h"

size_t max_pool_size(size_t n)
{
    return n < 3 ? 1 : (n - 2) / 2 + 1;
}

void max_pool_plan(struct max_pool *m, struct nn_plan *p, size_t batch,
                   size_t h, size_t w, size_t channels)
{
    assert(channels % 16 == 0 && h > 1 && w > 1);
    *m = (struct max_pool){ .batch = batch, .h = h, .w = w,
                            .oh = max_pool_size(h), .ow = max_pool_size(w),
                            .channels = channels };
    if (nn_plan_backward(p))
        m->which = nn_plan_floats(p, batch * m->oh * m->ow * channels);
}

/* One row. */
PARALLEL(max_pool_forward_part, r, const struct nn_kernels *, k, float *, out,
         struct max_pool *, m, const float *, in, size_t, row, size_t, image)
{
    k->max_pool_row(out + r * row, m->which ? m->which + r * row : NULL,
                    in + r / m->oh * image, m, r % m->oh);
}

void max_pool_forward(float *out, const float *in, struct max_pool *m)
{
    const struct nn_kernels *k = nn_kernels();
    size_t row = m->ow * m->channels, image = m->h * m->w * m->channels;

    parallel_each(max_pool_forward_part, m->batch * m->oh, 1, k, out, m, in,
                  row, image);
}

/* One row. */
PARALLEL(max_pool_backward_part, r, const struct nn_kernels *, k, float *, din,
         const struct max_pool *, m, const float *, dout, size_t, image)
{
    k->max_pool_row_backward(din + r * m->w * m->channels,
                             dout + r / m->h * image,
                             m->which + r / m->h * image, m, r % m->h);
}

/* In the forward pass: out = in[which]; windows overlap by a pixel. */
void max_pool_backward(float *din, const float *dout,
                       const struct max_pool *m)
{
    const struct nn_kernels *k = nn_kernels();
    size_t image = m->oh * m->ow * m->channels;

    parallel_each(max_pool_backward_part, m->batch * m->h, 1, k, din, m, dout,
                  image);
}
