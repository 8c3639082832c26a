/* How a convolution's pass is cut into bands, each a convolution of its own:
 * whole images, or rows of one. */
#include "lib/base/parallel.h"
#include "lib/nn/conv_impl.h"

/* Rows [y0,y1) of one image of the output as a convolution of its own; first:
 * the first row of the input that it sees. */
struct conv_shape conv_band_of_output(const struct conv_shape *s,
                                          const struct conv *c, size_t y0,
                                          size_t y1, size_t *first)
{
    struct conv_shape b = *s;
    size_t lo = y0 * c->stride, hi = (y1 - 1) * c->stride + c->kernel;

    b.n = 1;
    b.oh = y1 - y0;
    b.top = lo < s->top ? s->top - lo : 0;
    *first = lo < s->top ? 0 : lo - s->top;
    size_t end = hi - s->top;
    b.bottom = end > s->h ? end - s->h : 0;
    b.h = (end > s->h ? s->h : end) - *first;
    return b;
}

/* Rows [y0,y1) of one image of the input as a convolution of its own, whose
 * outputs are all that see them; first: the first of these. */
static struct conv_shape conv_band_of_input(const struct conv_shape *s,
                                                const struct conv *c,
                                                size_t y0, size_t y1,
                                                size_t *first)
{
    struct conv_shape b = *s;
    const size_t k = c->kernel, lo = y0 + s->top, hi = y1 - 1 + s->top;

    *first = lo < k - 1 ? 0 : (lo - (k - 1) + c->stride - 1) / c->stride;
    size_t end = hi / c->stride + 1 < s->oh ? hi / c->stride + 1 : s->oh;
    b.n = 1;
    b.h = y1 - y0;
    b.oh = end > *first ? end - *first : 0;
    b.top = lo > *first * c->stride ? lo - *first * c->stride : 0;
    size_t seen = (end - 1) * c->stride + k;    /* padded rows */
    b.bottom = seen > hi + 1 ? seen - (hi + 1) : 0;
    return b;
}

#define BAND_WORK 2000000        /* products that are worth a band */

/* Into how many bands a pass is cut: for the threads that the planning one
 * shares work with, two each, so that one put off holds up little. */
size_t conv_band_count(const struct conv *c,
                                     const struct conv_shape *s, size_t rows)
{
    const size_t work = s->n * s->oh * s->ow * c->out * c->in_data *
                        c->kernel * c->kernel;
    const size_t threads = (size_t)parallel_threads();
    size_t n = work / BAND_WORK < 2 * threads ? work / BAND_WORK : 2 * threads;

    n = n < CONV_BANDS ? n : CONV_BANDS;
    n = n < s->n * rows ? n : s->n * rows;
    return threads == 1 || n < 2 ? 1 : n;
}

/* Band i of n: whole images, or where there are fewer, rows of one. */
struct conv_shape conv_band_cut(struct conv_band *band,
                                         const struct conv *c,
                                         const struct conv_shape *s, size_t i,
                                         size_t n, bool back)
{
    const size_t each = n / s->n, rows = back ? s->h : s->oh;
    const size_t in = s->w * c->in_data, out = s->ow * c->out;
    size_t image = i * s->n / n, first = 0, y0 = 0;
    struct conv_shape b = *s;

    if (each > 1) {
        const size_t step = back ? c->stride : 1;
        const size_t units = (rows + step - 1) / step, k = i % each;
        size_t y1 = (k + 1) * units / each * step;

        image = i / each;
        y0 = k * units / each * step;
        y1 = y1 < rows ? y1 : rows;
        b = back ? conv_band_of_input(s, c, y0, y1, &first)
                 : conv_band_of_output(s, c, y0, y1, &first);
    } else {
        b.n = (i + 1) * s->n / n - image;
    }
    band->in_at = (image * s->h + (back ? y0 : first)) * in;
    band->out_at = (image * s->oh + (back ? first : y0)) * out;
    return b;
}
