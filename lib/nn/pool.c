/* Max pooling over rows, which the kernels take one at a time. */
#include "lib/nn/pool.h"

#include <assert.h>

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

void max_pool_forward(float *out, const float *in, struct max_pool *m)
{
    const struct nn_kernels *k = nn_kernels();
    size_t row = m->ow * m->channels, image = m->h * m->w * m->channels;
#pragma omp parallel for schedule(static)
    for (size_t r = 0; r < m->batch * m->oh; r++)
        k->max_pool_row(out + r * row, m->which ? m->which + r * row : NULL,
                        in + r / m->oh * image, m, r % m->oh);
}

/* In the forward pass: out = in[which]; windows overlap by a pixel. */
void max_pool_backward(float *din, const float *dout,
                       const struct max_pool *m)
{
    const struct nn_kernels *k = nn_kernels();
    size_t image = m->oh * m->ow * m->channels;
#pragma omp parallel for schedule(static)
    for (size_t r = 0; r < m->batch * m->h; r++)
        k->max_pool_row_backward(din + r * m->w * m->channels,
                                 dout + r / m->h * image,
                                 m->which + r / m->h * image, m, r % m->h);
}
