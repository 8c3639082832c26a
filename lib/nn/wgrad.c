/* The weights' gradient in bfloat16: planning, and the split over rows into a
 * fixed number of parts, so that any number of threads gives the same bits. */
#include "lib/nn/wgrad.h"

#include <string.h>

#include "lib/base/parallel.h"
#include "lib/nn/conv_impl.h"
#include "lib/nn/kernels.h"
#include "lib/nn/pairs_size.h"

#define CACHE ((size_t)640 << 10)   /* bytes of a part's pairs of inputs */
#define NEAR 160                    /* pairs that the next cache holds */
#define WGRAD_TAPS 49                /* of the largest kernel */
#define STRIP 256                   /* pixels of a row where rows say nothing */

_Static_assert(NN_PARTS == 4, "wgrad_sum_parts adds four");

bool wgrad_wanted(const struct conv *c)
{
    if (c->half_in || c->half_out)
        return true;
    return nn_plan_backward(c->plan) && c->plan->opt.type == NN_BF16 &&
           cpu_level() == CPU_AVX512 && c->in >= 8 && c->out >= 8 &&
           c->kernel * c->kernel <= WGRAD_TAPS &&
           c->batch * c->h * c->w >= 256;
}

/* n up to a multiple of m. */
static size_t wgrad_up(size_t n, size_t m)
{
    return (n + m - 1) / m * m;
}

/* A layer of single pixels: all images are one strip of rows. */
static void wgrad_plan_strip(struct wgrad *g)
{
    g->in_pixels = g->out_pixels = g->images * g->oh * g->ow;
    g->images = 1;
    g->w = g->ow = STRIP;
    g->h = g->oh = (g->out_pixels + STRIP - 1) / STRIP;
}

/* How rows are cut, and the room that they take. */
static void wgrad_plan_rows(struct wgrad *g)
{
    const size_t M = g->kernel * g->in, few = g->stride < g->kernel
                                            ? (g->kernel - 1) / g->stride : 0;

    g->pairs = (g->ow + 1) / 2;
    g->wide = wgrad_up(g->out, PAIRS_PANEL);
    /* an odd number of lines of the cache: pairs spread over all its sets */
    g->ld = wgrad_up(wgrad_up(M + (g->in % PAIRS_PANEL ? PAIRS_PANEL : 0),
                              PAIRS_ROWS), PAIRS_PANEL);
    g->ld += g->ld / PAIRS_PANEL % 2 ? 0 : PAIRS_PANEL;
    g->rows = CACHE / (g->pairs * g->ld * sizeof(uint32_t));
    g->rows = g->rows > few + 1 ? g->rows - few : 1;
    g->few = g->pairs < NEAR ? NEAR / g->pairs : 1;
    g->words = g->rows * g->pairs * g->wide +
               (g->rows + few) * g->pairs * g->ld + PAIRS_ROWS;
    g->words = wgrad_up(g->words, PAIRS_PANEL);
}

void wgrad_plan(struct wgrad *g, const struct conv *c,
                const struct conv_shape *s)
{
    *g = (struct wgrad){
        .plan = c->plan, .images = s->n, .h = s->h, .w = s->w, .oh = s->oh,
        .ow = s->ow, .in = c->in, .out = c->out, .kernel = c->kernel,
        .stride = c->stride, .top = s->top, .left = s->left,
        .in_row = c->in_data, .half_in = c->half_in,
        .half_out = c->half_out, .in_pixels = s->h * s->w,
        .out_pixels = s->oh * s->ow
    };
    if (c->kernel == 1 && c->stride == 1)
        wgrad_plan_strip(g);
    wgrad_plan_rows(g);
    g->dw = nn_plan_floats(c->plan, NN_PARTS * g->kernel * g->kernel * g->in *
                                        g->wide);
    nn_plan_scratch(c->plan, NN_PARTS * g->words * sizeof(uint32_t));
}

/* Part i of the rows of all images' outputs, one after another. */
PARALLEL(wgrad_sum, i, const struct wgrad *, g, const void *, dout,
         const void *, in)
{
    const size_t all = g->images * g->oh, to = (i + 1) * all / NN_PARTS;
    const size_t each = g->kernel * g->kernel * g->in * g->wide;
    const size_t out_image = g->oh * g->ow * g->out *
                             (g->half_out ? sizeof(uint16_t) : sizeof(float));
    const size_t in_image = g->h * g->w * g->in_row *
                            (g->half_in ? sizeof(uint16_t) : sizeof(float));

    uint32_t *room = (uint32_t *)(void *)g->plan->scratch + i * g->words;
    float *dw = g->dw + i * each;
    size_t from = i * all / NN_PARTS;

    memset(dw, 0, each * sizeof *dw);
    while (from < to) {
        const size_t image = from / g->oh, y = from % g->oh;
        size_t rows = to - from < g->oh - y ? to - from : g->oh - y;

        rows = rows < g->rows ? rows : g->rows;
        nn_kernels()->wgrad_rows(dw, (const char *)dout + image * out_image,
                                 (const char *)in + image * in_image, room, g,
                                 y, rows);
        from += rows;
    }
}

/* sum (taps,16) of the parts, for input channel i and outputs from o on. */
static void wgrad_sum_parts(float *sum, const struct wgrad *g, size_t i,
                            size_t o)
{
    const size_t k = g->kernel, M = k * g->in, each = k * M * g->wide;

    for (size_t t = 0; t < k * k; t++, sum += PAIRS_PANEL) {
        const float *p = g->dw + (t / k * M + t % k * g->in + i) * g->wide + o;

        for (size_t n = 0; n < PAIRS_PANEL; n++)
            sum[n] = ((p[n] + p[each + n]) + p[2 * each + n]) +
                     p[3 * each + n];
    }
}

/* Input channel i: all its weights' parts, into the checkpoint's layout. */
PARALLEL(wgrad_scatter, i, float *, dw, const struct wgrad *, g)
{
    const size_t taps = g->kernel * g->kernel;
    float sum[WGRAD_TAPS * PAIRS_PANEL];

    for (size_t o = 0; o < g->out; o += PAIRS_PANEL) {
        wgrad_sum_parts(sum, g, i, o);
        for (size_t n = 0; n < PAIRS_PANEL && o + n < g->out; n++) {
            float *to = dw + ((o + n) * g->in_row + i) * taps;

            for (size_t t = 0; t < taps; t++)
                to[t] += sum[t * PAIRS_PANEL + n];
        }
    }
}

void wgrad_add(float *dw, const void *dout, const void *in, struct wgrad *g)
{
    parallel_each(wgrad_sum, NN_PARTS, 1, g, dout, in);
    parallel_each(wgrad_scatter, g->in, 1, dw, g);
}
