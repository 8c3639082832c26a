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

struct max_pool_forward_part {
    const struct nn_kernels *k;
    float *out;
    struct max_pool *m;
    const float *in;
    size_t row, image;
};

/* One row. */
static void max_pool_forward_part(void *ctx, size_t r)
{
    const struct max_pool_forward_part *c = ctx;

    c->k->max_pool_row(c->out + r * c->row,
                       c->m->which ? c->m->which + r * c->row : NULL,
                       c->in + r / c->m->oh * c->image, c->m, r % c->m->oh);
}

void max_pool_forward(float *out, const float *in, struct max_pool *m)
{
    const struct nn_kernels *k = nn_kernels();
    size_t row = m->ow * m->channels, image = m->h * m->w * m->channels;

    parallel_for(m->batch * m->oh, 1, max_pool_forward_part,
                 &(struct max_pool_forward_part){ k, out, m, in, row, image });
}

struct max_pool_backward_part {
    const struct nn_kernels *k;
    float *din;
    const struct max_pool *m;
    const float *dout;
    size_t image;
};

/* One row. */
static void max_pool_backward_part(void *ctx, size_t r)
{
    const struct max_pool_backward_part *c = ctx;

    c->k->max_pool_row_backward(
        c->din + r * c->m->w * c->m->channels, c->dout + r / c->m->h * c->image,
        c->m->which + r / c->m->h * c->image, c->m, r % c->m->h);
}

/* In the forward pass: out = in[which]; windows overlap by a pixel. */
void max_pool_backward(float *din, const float *dout,
                       const struct max_pool *m)
{
    const struct nn_kernels *k = nn_kernels();
    size_t image = m->oh * m->ow * m->channels;

    parallel_for(m->batch * m->h, 1, max_pool_backward_part,
                 &(struct max_pool_backward_part){ k, din, m, dout, image });
}
