/* Convolutions as a product of unfolded windows (im2col) and weights, each sum
 * made in pieces of at most 128 terms. */
#include "lib/nn/im2col.h"

#include <string.h>

#include "lib/base/parallel.h"
#include "lib/nn/conv_impl.h"
#include "lib/nn/kernels.h"

#define PIECE 128        /* terms of one chain, at most */
#define BAND 1024        /* pixels unfolded at a time */
#define COLUMNS 64       /* of a piece of work: two panels of gemm's */
#define ROWS 48

bool im2col_wanted(const struct conv *c)
{
    size_t terms = c->kernel * c->kernel * c->in_data;
    bool few = c->h * c->w <= 256 && c->kernel == 3;

    return c->pad == CONV_HALF && c->act <= ACT_LRELU &&
           (nn_plan_type(c->plan) == NN_F32 ? terms >= 512
                                            : few && terms >= 2048);
}

void im2col_plan(struct conv *c, const struct conv_shape *s)
{
    struct im2col *t = &c->impl->im2col;
    struct nn_plan *p = c->plan;
    size_t pixels = c->batch * c->oh * c->ow;
    size_t rows = pixels < BAND ? pixels : BAND;

    t->c = c;
    t->top = s->top;
    t->left = s->left;
    t->K = c->kernel * c->kernel * c->in_data;
    t->N = (c->out + COLUMNS - 1) / COLUMNS * COLUMNS;
    t->w = nn_plan_floats(p, t->K * t->N);
    t->rows = c->kernel == 1 && c->stride == 1
                  ? NULL : nn_plan_floats(p, rows * t->K);
    t->sum = c->add ? nn_plan_floats(p, rows * c->out) : NULL;
}

/* How many pieces a sum is made in. */
static size_t im2col_pieces(const struct im2col *t)
{
    size_t taps = t->c->kernel * t->c->kernel;

    return taps * ((t->c->in_data + PIECE - 1) / PIECE);
}

/* Piece j of the sum: rows [first, first + length) of (K, out). */
static size_t im2col_piece(const struct im2col *t, size_t j, size_t *first)
{
    size_t in = t->c->in_data, each = (in + PIECE - 1) / PIECE;
    size_t at = j % each * PIECE;

    *first = j / each * in + at;
    return in - at < PIECE ? in - at : PIECE;
}

PARALLEL(im2col_update_part, j, struct im2col *, t, const float *, w,
         size_t, in, size_t, taps, size_t, out)
{
    size_t first, terms = im2col_piece(t, j, &first);

    nn_kernels()->gemm_pack(t->w + first * t->N,
                            w + first % in * taps + first / in, taps,
                            taps * in, terms, out);
}

/* w (out,in,k,k): term (tap,i) of the sum is row tap * in + i of a matrix. */
void im2col_update(struct conv *c, const float *w)
{
    struct im2col *t = &c->impl->im2col;

    parallel_each(im2col_update_part, im2col_pieces(t), 1, t, w, c->in_data,
                  c->kernel * c->kernel, c->out);
}

/* What the window of one pixel of the output sees. */
PARALLEL(im2col_unfold_part, row, const struct im2col *, t, const float *, in,
         size_t, m0)
{
    const struct conv *c = t->c;
    const size_t r = m0 + row, n = r / (c->oh * c->ow), C = c->in_data;
    const size_t y = r / c->ow % c->oh * c->stride;
    const size_t x = r % c->ow * c->stride;
    float *to = t->rows + row * t->K;

    for (size_t tap = 0; tap < c->kernel * c->kernel; tap++, to += C) {
        const size_t yy = y + tap / c->kernel;  /* t->top too many */
        const size_t xx = x + tap % c->kernel;

        if (yy < t->top || yy >= c->h + t->top || xx < t->left ||
            xx >= c->w + t->left)
            memset(to, 0, C * sizeof *to);
        else
            memcpy(to,
                   in + ((n * c->h + yy - t->top) * c->w + xx - t->left) * C,
                   C * sizeof *to);
    }
}

/* rows (M,K): what the windows of pixels [m0, m0 + M) of the output see, zeros
 * outside the picture. */
static void im2col_unfold(const float *in, struct im2col *t, size_t m0,
                          size_t M)
{
    parallel_each(im2col_unfold_part, M, 1, t, in, m0);
}

PARALLEL(im2col_multiply_part, at, float *, out, const float *, rows,
         const struct im2col *, t, size_t, M)
{
    const size_t N = t->c->out, across = t->N / COLUMNS;
    size_t m0 = at / across * ROWS, n0 = at % across * COLUMNS;
    size_t n = N - n0 < COLUMNS ? N - n0 : COLUMNS;
    size_t m = M - m0 < ROWS ? M - m0 : ROWS;

    for (size_t j = 0; j < im2col_pieces(t); j++) {
        size_t first, terms = im2col_piece(t, j, &first);

        nn_kernels()->gemm(out + m0 * N + n0, N, rows + m0 * t->K + first,
                           t->K, 1, t->w + first * t->N + n0 * terms, m, n,
                           terms, j > 0);
    }
}

static void im2col_add(float *restrict to, const float *restrict x, size_t n)
{
    for (size_t i = 0; i < n; i++)
        to[i] += x[i];
}

/* out (M, out) of the unfolded rows. */
static void im2col_multiply(float *out, const float *rows,
                            const struct im2col *t, size_t M)
{
    const size_t N = t->c->out;
    float *sum = t->sum ? t->sum : out;

    parallel_each(im2col_multiply_part,
                  (M + ROWS - 1) / ROWS * (t->N / COLUMNS), 1, sum, rows, t,
                  M);
    for (size_t r = 0; r < M; r++)
        im2col_add(sum + r * N, t->c->impl->bias, N);
    if (t->sum)
        im2col_add(out, t->sum, M * N);
}

void im2col_forward(float *out, const float *in, struct conv *c)
{
    struct im2col *t = &c->impl->im2col;
    size_t pixels = c->batch * c->oh * c->ow;

    for (size_t m = 0; m < pixels; m += BAND) {
        size_t M = pixels - m < BAND ? pixels - m : BAND;

        if (t->rows)
            im2col_unfold(in, t, m, M);
        im2col_multiply(out + m * c->out, t->rows ? t->rows : in + m * t->K, t,
                        M);
    }
    if (c->act != ACT_NONE)
        act_forward(out, out, c->act, pixels * c->out);
}
