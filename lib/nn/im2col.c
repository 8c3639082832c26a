/* Convolutions as a product of unfolded windows (im2col) and weights, each sum
 * made in pieces of at most 128 terms. */
#include "lib/nn/im2col.h"

#include <string.h>

#include "lib/base/parallel.h"
#include "lib/nn/conv_impl.h"
#include "lib/nn/kernels.h"

#define PIECE 128        /* terms of one chain, at most */
#define PANEL 32         /* columns of gemm's weights */
#define BLOCK 12         /* pixels that gemm takes at once */
#define BLOCKS 4         /* of them a piece of work, at most */

bool im2col_wanted(const struct conv *c)
{
    const size_t terms = c->kernel * c->kernel * c->in_data;
    const bool few = c->h * c->w <= 256 && c->kernel == 3;

    if (c->kernel == 1 && c->stride == 1 && !nn_plan_backward(c->plan))
        return c->act != ACT_GELU;
    return c->pad == CONV_HALF && c->act <= ACT_LRELU &&
           (nn_plan_type(c->plan) == NN_F32 ? terms >= 512
                                            : few && terms >= 2048);
}

/* n / m, rounded up. */
static size_t im2col_up(size_t n, size_t m)
{
    return (n + m - 1) / m;
}

void im2col_plan(struct conv *c, const struct conv_shape *s)
{
    const size_t parts = 2 * (size_t)parallel_threads();
    const size_t blocks = c->batch * c->oh * c->ow / parts / BLOCK;
    struct im2col *t = &c->impl->im2col;

    t->c = c;
    t->top = s->top;
    t->left = s->left;
    t->K = c->kernel * c->kernel * c->in_data;
    t->N = im2col_up(c->out, PANEL) * PANEL;
    t->piece = im2col_up(c->in_data, im2col_up(c->in_data, PIECE));
    t->w = nn_plan_floats(c->plan, t->K * t->N);
    t->rows = BLOCK * (blocks < 1 ? 1 : blocks < BLOCKS ? blocks : BLOCKS);
    t->unfold = c->kernel > 1 || c->stride > 1 ? t->rows * t->K : 0;
    t->own = t->unfold + (c->add ? t->rows * c->out : 0);
    nn_plan_scratch(c->plan, t->own * sizeof(float) * (size_t)parallel_width());
}

/* How many terms the piece has that begins with number `first`: all of a tap. */
static size_t im2col_terms(const struct im2col *t, size_t first)
{
    const size_t rest = t->c->in_data - first % t->c->in_data;

    return rest < t->piece ? rest : t->piece;
}

/* A panel of w (out,in,k,k), as gemm_pack lays out each piece: term (tap,i) of
 * the sum is row tap * in + i of a matrix.  Some terms at a time, whose rows
 * stay near. */
PARALLEL(im2col_update_part, panel, struct im2col *, t, const float *, w)
{
    enum { SOME = 16 };
    const struct conv *c = t->c;
    const size_t in = c->in_data, taps = c->kernel * c->kernel;
    const size_t rest = c->out - panel * PANEL;

    for (size_t first = 0, terms; first < t->K; first += terms) {
        const size_t tap = first / in, i = first % in;
        float *to = t->w + first * t->N;

        terms = im2col_terms(t, first);
        to += panel * terms * PANEL;
        for (size_t at = 0; at < terms; at += SOME)
            for (size_t o = 0; o < PANEL && o < rest; o++) {
                const float *from = w + ((panel * PANEL + o) * in + i) * taps;

                for (size_t k = at; k < at + SOME && k < terms; k++)
                    to[k * PANEL + o] = from[k * taps + tap];
            }
    }
}

void im2col_update(struct conv *c, const float *w)
{
    struct im2col *t = &c->impl->im2col;

    parallel_each(im2col_update_part, t->N / PANEL, 1, t, w);
}

/* n floats, which are too few for a call. */
static inline void im2col_copy(float *to, const float *from, size_t n)
{
    size_t i = 0;

    for (; i + 4 <= n; i += 4)
        memcpy(to + i, from + i, 4 * sizeof *to);
    for (; i < n; i++)
        to[i] = from[i];
}

/* What the window at pixel (x,y) of the padded image `in` sees, zeros outside:
 * row by row. */
static void im2col_window(float *to, const float *in, const struct im2col *t,
                          size_t x, size_t y)
{
    const struct conv *c = t->c;
    const size_t C = c->in_data, k = c->kernel;
    const size_t from = x < t->left ? t->left - x : 0;
    const size_t room = c->w + t->left - x, end = room < k ? room : k;

    for (size_t i = y; i < y + k; i++, to += k * C) {
        const bool inside = i >= t->top && i < c->h + t->top;

        if (!inside || end - from < k)
            memset(to, 0, k * C * sizeof *to);
        if (inside)
            im2col_copy(to + from * C,
                        in + ((i - t->top) * c->w + x + from - t->left) * C,
                        (end - from) * C);
    }
}

/* Those of m pixels of the output, from number `first`. */
static void im2col_unfold(float *to, const float *in, const struct im2col *t,
                          size_t first, size_t m)
{
    const struct conv *c = t->c;
    size_t x = first % c->ow, y = first / c->ow % c->oh;
    size_t n = first / c->ow / c->oh;

    for (; m > 0; m--, to += t->K) {
        im2col_window(to, in + n * c->h * c->w * c->in_data, t, x * c->stride,
                      y * c->stride);
        x++;
        y += x == c->ow;
        n += y == c->oh;
        x = x < c->ow ? x : 0;
        y = y < c->oh ? y : 0;
    }
}

/* Some pixels of the output: the pieces of the sum and the bias, what is there
 * already, the activation. */
PARALLEL(im2col_forward_part, part, float *, out, const float *, in,
         const struct im2col *, t, size_t, pixels)
{
    const struct nn_kernels *k = nn_kernels();
    const struct conv *c = t->c;
    const size_t N = c->out, m0 = part * t->rows;
    const size_t m = pixels - m0 < t->rows ? pixels - m0 : t->rows;
    const float *rows = in + m0 * t->K;
    float *own = (float *)(void *)c->plan->scratch + parallel_slot() * t->own;
    const bool one = im2col_terms(t, 0) == t->K;
    float *sum = c->add ? own + t->unfold : out + m0 * N;

    if (t->unfold) {
        im2col_unfold(own, in, t, m0, m);
        rows = own;
    }
    for (size_t first = 0, terms; first < t->K; first += terms) {
        terms = im2col_terms(t, first);
        k->gemm(sum, N, rows + first, t->K, 1, t->w + first * t->N, m, N,
                terms, first ? sum : one ? c->impl->bias : NULL,
                first ? N : 0);
    }
    for (size_t r = 0; !one && r < m; r++)
        k->add(sum + r * N, c->impl->bias, N);
    if (c->add)
        k->add(out + m0 * N, sum, m * N);
    if (c->act != ACT_NONE)
        k->act_forward(out + m0 * N, out + m0 * N, (int)c->act, m * N);
}

void im2col_forward(float *out, const float *in, struct conv *c)
{
    struct im2col *t = &c->impl->im2col;
    const size_t pixels = c->batch * c->oh * c->ow;

    parallel_each(im2col_forward_part, im2col_up(pixels, t->rows), 1, out, in, t,
                  pixels);
}
