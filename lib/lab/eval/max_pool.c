/* Max pooling row by row, all channels of a pixel at a time. */
#include "lib/lab/eval/max_pool.h"

#include <assert.h>
#include <string.h>

#include "lib/base/parallel.h"

/* Pixels that come of n, which is 3 or more, or 2 where windows may be cut. */
static size_t max_pool_size(size_t n, bool cut)
{
    return n < 3 ? 1 : (n - (cut ? 2 : 3)) / 2 + 1;
}

void max_pool_plan(struct max_pool *m, struct nn_plan *p, size_t batch,
                   size_t h, size_t w, size_t channels, size_t before,
                   bool cut)
{
    assert(h > 1 && w > 1);
    *m = (struct max_pool){ .batch = batch, .h = h, .w = w,
                            .oh = max_pool_size(h + before, cut),
                            .ow = max_pool_size(w + before, cut),
                            .before = before, .channels = channels };
    if (nn_plan_backward(p))
        m->which = nn_plan_floats(p, batch * m->oh * m->ow * channels);
}

/* Row r of all images. */
PARALLEL(max_pool_forward_part, r, float *, out, struct max_pool *, m,
         const float *, in)
{
    const size_t C = m->channels, image = r / m->oh * m->h;

    for (size_t ox = 0; ox < m->ow; ox++) {
        float *to = out + (r * m->ow + ox) * C;
        float *which = m->which ? m->which + (r * m->ow + ox) * C : NULL;
        bool begun = false;

        for (size_t k = 0; k < 9; k++) {
            /* before the border they are past its other end */
            const size_t y = 2 * (r % m->oh) + k / 3 - m->before;
            const size_t x = 2 * ox + k % 3 - m->before;
            const float *from = in + ((image + y) * m->w + x) * C;

            if (y >= m->h || x >= m->w)
                continue;
            for (size_t c = 0; which && c < C; c++)
                which[c] = !begun || from[c] > to[c] ? (float)k : which[c];
            for (size_t c = 0; c < C; c++)
                to[c] = !begun || from[c] > to[c] ? from[c] : to[c];
            begun = true;
        }
    }
}

void max_pool_forward(float *out, const float *in, struct max_pool *m)
{
    parallel_each(max_pool_forward_part, m->batch * m->oh, 1, out, m, in);
}

/* Row r of all images: from the at most four windows that a pixel lies in, in
 * order.  In the forward pass: out = in[which]. */
PARALLEL(max_pool_backward_part, r, float *, din, const struct max_pool *, m,
         const float *, dout)
{
    const size_t C = m->channels, y = r % m->h;
    const size_t image = r / m->h * m->oh;
    const size_t y1 = y / 2 < m->oh ? y / 2 : m->oh - 1;

    for (size_t x = 0; x < m->w; x++) {
        const size_t x1 = x / 2 < m->ow ? x / 2 : m->ow - 1;
        float *to = din + (r * m->w + x) * C;

        memset(to, 0, C * sizeof *to);
        for (size_t oy = y < 2 ? 0 : (y - 1) / 2; oy <= y1; oy++)
            for (size_t ox = x < 2 ? 0 : (x - 1) / 2; ox <= x1; ox++) {
                const size_t at = ((image + oy) * m->ow + ox) * C;
                const float place = (float)(3 * (y - 2 * oy) + x - 2 * ox);

                for (size_t c = 0; c < C; c++)
                    to[c] += m->which[at + c] == place ? dout[at + c] : 0;
            }
    }
}

void max_pool_backward(float *din, const float *dout,
                       const struct max_pool *m)
{
    assert(!m->before);
    parallel_each(max_pool_backward_part, m->batch * m->h, 1, din, m, dout);
}
