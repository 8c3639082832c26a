/* Depthwise convolution of 16 channels at a time.  The input piece is first
 * copied into a padded buffer (row, column, 16 lanes), so that the arithmetic
 * has no borders: seven output columns of one vector of channels in
 * registers. */
#include "lib/nn/depthwise.h"
#include "lib/nn/kernels.h"
#include "lib/nn/math.h"
#include "lib/nn/vector.h"

#define T DEPTHWISE_COLUMNS
#define LANES DEPTHWISE_LANES

/* A picture (h,w,C) whose channels [c0,c0+m) are read. */
struct depthwise_source {
    const float *data;
    size_t h, w, C, c0, m;
};

/* One row of the picture into to (w, 16 lanes), step lanes apart. */
VEC_INLINE void depthwise_copy_row(float *to, size_t step,
                                   const struct depthwise_source *s, size_t y)
{
    size_t at = y * s->w * s->C + s->c0;
    const float *p = s->data + at;

    if (s->m == LANES)
        for (size_t x = 0; x < s->w; x++, p += s->C, to += step)
            for (size_t i = 0; i < LANES; i += VEC)
                vf_store(to + i, vf_load(p + i));
    else if (s->m == LANES / 2)
        for (size_t x = 0; x < s->w; x++, p += s->C, to += step)
            memcpy(to, p, LANES / 2 * sizeof *p);
    else
        for (size_t x = 0; x < s->w; x++, p += s->C, to += step)
            memcpy(to, p, s->m * sizeof *p);
}

/* pad (rows,cols,16) <- the picture from row y0 and column x0 on (either may
 * be negative), its pixels `dilate` apart, zeros elsewhere. */
static void depthwise_fill(float *pad, const struct depthwise_source *s,
                           ptrdiff_t y0, size_t rows, ptrdiff_t x0,
                           size_t cols, size_t dilate)
{
    ptrdiff_t d = (ptrdiff_t)dilate;

    for (size_t r = 0; r < rows; r++) {
        ptrdiff_t y = y0 + (ptrdiff_t)r;
        float *row = pad + r * cols * LANES;
        bool inside = y >= 0 && y % d == 0 && y / d < (ptrdiff_t)s->h;
        size_t left = (size_t)-x0, used = (s->w - 1) * dilate + 1;

        if (!inside || dilate > 1) {
            memset(row, 0, cols * LANES * sizeof *row);
        } else {
            memset(row, 0, left * LANES * sizeof *row);
            if (left + used < cols)
                memset(row + (left + used) * LANES, 0,
                       (cols - left - used) * LANES * sizeof *row);
        }
        if (inside)
            depthwise_copy_row(row + left * LANES, dilate * LANES, s,
                               (size_t)(y / d));
    }
}

/* seven columns of one row: acc = bias + sum of taps */
VEC_INLINE void depthwise_columns(vf acc[T], const float *pad,
                                  const float *taps, vf bias, size_t cols,
                                  int K, int S)
{
    for (int t = 0; t < T; t++)
        acc[t] = bias;
    for (int ky = 0; ky < K; ky++)
        for (int kx = 0; kx < K; kx++) {
            vf w = vf_load(taps + (ky * K + kx) * LANES);
            const float *p = pad + ((size_t)ky * cols + (size_t)kx) * LANES;
            for (int t = 0; t < T; t++)
                acc[t] += w * vf_load(p + t * S * LANES);
        }
}

/* Where results go: (ow,C) rows, channels [c0,c0+m). */
struct depthwise_target {
    float *data;
    size_t w, C, c0, m;
};

/* math_act, to the bit: a loop over lanes stays scalar code. */
VEC_INLINE vf depthwise_activate(vf x, int act)
{
    vf zero = { 0 }, t;

    switch (act) {
    case ACT_RELU:
        return vf_max(x, zero);
    case ACT_HARDSWISH:
        t = vf_min(vf_set(6), vf_max(zero, x + 3));
        return x * t * (1.0f / 6);
    default:
        return x;
    }
}

/* Lanes [lane, lane + VEC) of the 16, as far as there are channels. */
VEC_INLINE void depthwise_store(const struct depthwise_target *o, size_t y,
                                size_t x, size_t lane, vf v, int act)
{
    float *to = o->data + (y * o->w + x) * o->C + o->c0 + lane;
    size_t left = o->m - lane;

    v = depthwise_activate(v, act);
    if (left >= VEC)
        vf_store(to, v);
    else if (left == LANES / 2)
        memcpy(to, &v, LANES / 2 * sizeof *to);
    else
        memcpy(to, &v, left * sizeof *to);
}

/* Rows [y0,y1) of the output from pad, whose first row is y0's first tap.
 * taps (K*K,16); bias 16 lanes. */
VEC_INLINE void depthwise_rows(const struct depthwise_target *o,
                               const float *pad, const float *taps,
                               const float *bias, size_t y0, size_t y1,
                               size_t cols, int K, int S, int act)
{
    vf acc[T];

    for (size_t y = y0; y < y1; y++)
        for (size_t x = 0; x < o->w; x += T)
            for (size_t i = 0; i < LANES && i < o->m; i += VEC) {
                const float *p = pad +
                    ((y - y0) * cols + x) * (size_t)S * LANES;

                depthwise_columns(acc, p + i, taps + i, vf_load(bias + i),
                                  cols, K, S);
                size_t n = o->w - x < T ? o->w - x : T;
                for (size_t t = 0; t < T; t++)
                    if (t < n)
                        depthwise_store(o, y, x + t, i, acc[t], act);
            }
}

/* depthwise_rows with kernel, stride and activation as constants. */
static void depthwise_rows_any(const struct depthwise_target *o,
                               const float *pad, const float *taps,
                               const float *bias, size_t y0, size_t y1,
                               size_t cols, size_t K, size_t S, int act)
{
#define LOOP(A)                                                              \
    if (K == 3 && S == 1)                                                    \
        depthwise_rows(o, pad, taps, bias, y0, y1, cols, 3, 1, A);           \
    else if (K == 3)                                                         \
        depthwise_rows(o, pad, taps, bias, y0, y1, cols, 3, 2, A);           \
    else if (S == 1)                                                         \
        depthwise_rows(o, pad, taps, bias, y0, y1, cols, 5, 1, A);           \
    else                                                                     \
        depthwise_rows(o, pad, taps, bias, y0, y1, cols, 5, 2, A);
    switch (act) {
    case ACT_RELU: LOOP(ACT_RELU) break;
    case ACT_HARDSWISH: LOOP(ACT_HARDSWISH) break;
    default: LOOP(ACT_NONE) break;
    }
#undef LOOP
}

/* Columns of the padded input for w outputs, whole groups of T. */
static size_t depthwise_padded_width(size_t w, size_t S, size_t K)
{
    return ((w + T - 1) / T * T - 1) * S + K;
}

/* Rows [y0,y1) of channels c0.. of one image; pad is the thread's buffer. */
void ISA(depthwise_forward)(float *out, const float *in, float *pad,
                            const struct depthwise *d, size_t image,
                            size_t c0, size_t y0, size_t y1)
{
    size_t C = d->channels, m = C - c0 < LANES ? C - c0 : LANES;
    struct depthwise_source s = { in + image * d->h * d->w * C, d->h, d->w,
                                  C, c0, m };
    struct depthwise_target o = { out + image * d->oh * d->ow * C, d->ow, C,
                                  c0, m };
    size_t cols = depthwise_padded_width(d->ow, d->stride, d->kernel);

    depthwise_fill(pad, &s, (ptrdiff_t)(y0 * d->stride) - (ptrdiff_t)d->top,
                   (y1 - y0 - 1) * d->stride + d->kernel, -(ptrdiff_t)d->left,
                   cols, 1);
    depthwise_rows_any(&o, pad, d->taps + c0 * d->kernel * d->kernel,
                       d->bias + c0, y0, y1, cols, d->kernel, d->stride,
                       (int)d->act);
}

/* Rows [y0,y1) of din: a convolution of the dilated dout, taps flipped. */
void ISA(depthwise_backward_data)(float *din, const float *dout, float *pad,
                                  const struct depthwise *d, size_t image,
                                  size_t c0, size_t y0, size_t y1)
{
    size_t C = d->channels, m = C - c0 < LANES ? C - c0 : LANES;
    const float zero[LANES] = { 0 };
    struct depthwise_source s = { dout + image * d->oh * d->ow * C, d->oh,
                                  d->ow, C, c0, m };
    struct depthwise_target o = { din + image * d->h * d->w * C, d->w, C, c0,
                                  m };
    size_t cols = depthwise_padded_width(d->w, 1, d->kernel), K = d->kernel;
    size_t used = K - 1 - d->left + (d->ow - 1) * d->stride + 1;

    if (cols < used)
        cols = used;
    depthwise_fill(pad, &s, (ptrdiff_t)(y0 + d->top) - (ptrdiff_t)(K - 1),
                   y1 - y0 + K - 1, (ptrdiff_t)d->left - (ptrdiff_t)(K - 1),
                   cols, d->stride);
    depthwise_rows_any(&o, pad, d->flipped + c0 * K * K, zero, y0, y1, cols, K,
                       1, ACT_NONE);
}

/* acc[K] += one row of dout times the K shifted rows of the input */
VEC_INLINE void depthwise_row_taps(vf *acc, const float *pad, const float *g,
                                   size_t w, int K, int S)
{
    for (size_t x = 0; x < w; x++) {
        vf dy = vf_load(g + x * LANES);
        const float *p = pad + x * (size_t)S * LANES;
        for (int k = 0; k < K; k++)
            acc[k] += dy * vf_load(p + k * LANES);
    }
}

/* sum (K*K,16) += the taps' gradients from `rows` rows of dout. */
VEC_INLINE void depthwise_weights(float *sum, const float *pad, const float *g,
                                  size_t rows, size_t w, size_t cols, int K,
                                  int S)
{
    for (int i = 0; i < LANES * K; i += VEC) {
        int ky = i / LANES, lane = i % LANES;
        float *to = sum + ky * K * LANES + lane;

        vf acc[5];
        for (int k = 0; k < K; k++)
            acc[k] = vf_load(to + k * LANES);
        for (size_t y = 0; y < rows; y++) {
            size_t row = (y * (size_t)S + (size_t)ky) * cols;

            depthwise_row_taps(acc, pad + row * LANES + lane,
                               g + y * w * LANES + lane, w, K, S);
        }
        for (int k = 0; k < K; k++)
            vf_store(to + k * LANES, acc[k]);
    }
}

/* dw (k*k,C), channels c0..: one image's share of the weight gradient. */
void ISA(depthwise_backward_weights)(float *dw, const float *dout,
                                     const float *in, float *pad,
                                     const struct depthwise *d, size_t image,
                                     size_t c0)
{
    size_t C = d->channels, m = C - c0 < LANES ? C - c0 : LANES;
    size_t K = d->kernel, S = d->stride;
    size_t cols = depthwise_padded_width(d->ow, S, K);
    float sum[25 * LANES] = { 0 };
    struct depthwise_source s = { in + image * d->h * d->w * C, d->h, d->w,
                                  C, c0, m };
    struct depthwise_source g = { dout + image * d->oh * d->ow * C, d->oh,
                                  d->ow, C, c0, m };
    float *rows = pad + ((DEPTHWISE_ROWS - 1) * S + K) * cols * LANES;

    for (size_t y0 = 0; y0 < d->oh; y0 += DEPTHWISE_ROWS) {
        size_t n = d->oh - y0 < DEPTHWISE_ROWS ? d->oh - y0 : DEPTHWISE_ROWS;

        depthwise_fill(pad, &s, (ptrdiff_t)(y0 * S) - (ptrdiff_t)d->top,
                       (n - 1) * S + K, -(ptrdiff_t)d->left, cols, 1);
        for (size_t y = 0; y < n; y++)
            depthwise_copy_row(rows + y * d->ow * LANES, LANES, &g, y0 + y);
        if (K == 3 && S == 1)
            depthwise_weights(sum, pad, rows, n, d->ow, cols, 3, 1);
        else if (K == 3)
            depthwise_weights(sum, pad, rows, n, d->ow, cols, 3, 2);
        else if (S == 1)
            depthwise_weights(sum, pad, rows, n, d->ow, cols, 5, 1);
        else
            depthwise_weights(sum, pad, rows, n, d->ow, cols, 5, 2);
    }
    for (size_t i = 0; i < K * K; i++)
        memcpy(dw + i * C + c0, sum + i * LANES, m * sizeof *dw);
}
