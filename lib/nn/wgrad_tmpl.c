/* The weights' gradient of a convolution by products of pairs (pairs.h): the
 * sum over pixels of input times gradient, for every row of the kernel.  What
 * the kernel's columns see of a row of the input stands side by side. */
#include "lib/nn/kernels.h"
#include "lib/nn/pairs.h"
#include "lib/nn/wgrad.h"

static const float wgrad_zero[PAIRS_PANEL];

/* Values of row y, of `row` pixels each, of an image of so many pixels. */
VEC_INLINE size_t wgrad_row_length(size_t y, size_t row, size_t pixels)
{
    return pixels - y * row < row ? pixels - y * row : row;
}

/* to (16) = pairs of values a and b on of x, n of each, of either type; where
 * there is none, zeros. */
VEC_INLINE void wgrad_lay_out(uint32_t *to, const void *x, bool has, size_t a,
                              bool more, size_t b, size_t n, const bool half)
{
    if (half) {
        const uint16_t *p = x, *zero = (const void *)wgrad_zero;

        pairs_join_rows(to, has ? p + a : zero, more ? p + b : zero, n);
    } else {
        const float *p = x;

        pairs_round_rows(to, has ? p + a : wgrad_zero,
                         more ? p + b : wgrad_zero, n);
    }
}

/* Row y of the gradient as panels of pairs, `panel` words apart.  The row after
 * it is on its way from memory meanwhile, which takes longer than the work. */
VEC_INLINE void wgrad_lay_out_gradient(uint32_t *to, size_t panel,
                                       const void *dout, const struct wgrad *g,
                                       size_t y, const bool half)
{
    const size_t n = wgrad_row_length(y, g->ow, g->out_pixels);
    const size_t size = half ? sizeof(uint16_t) : sizeof(float);

    for (size_t k = 0; k < g->pairs; k++)
        for (size_t o = 0; o < g->out; o += PAIRS_PANEL) {
            const size_t some = g->out - o < PAIRS_PANEL ? g->out - o
                                                         : PAIRS_PANEL;
            const size_t at = (y * g->ow + 2 * k) * g->out + o;
            const char *below = (const char *)dout +
                                (at + g->ow * g->out) * size;

            __builtin_prefetch(below, 0, 2);
            __builtin_prefetch(below + g->out * size, 0, 2);
            wgrad_lay_out(to + o / PAIRS_PANEL * panel + k * PAIRS_PANEL,
                          dout, 2 * k < n, at, 2 * k + 1 < n, at + g->out,
                          some, half);
        }
}

/* in channels of the pixels at x and x + stride of a row of n that begins at
 * `row`, zeros beside it.  The next row's are asked for. */
VEC_INLINE void wgrad_lay_out_pair(uint32_t *to, const void *in, size_t row,
                                   const struct wgrad *g, ptrdiff_t x,
                                   ptrdiff_t n, const bool half)
{
    const ptrdiff_t next = x + (ptrdiff_t)g->stride;
    const bool has = x >= 0 && x < n, more = next >= 0 && next < n;
    const size_t a = row + (size_t)x * g->in_row;
    const size_t b = row + (size_t)next * g->in_row;
    const size_t size = half ? sizeof(uint16_t) : sizeof(float);

    for (size_t c = 0; c < g->in; c += PAIRS_PANEL) {
        const size_t some = g->in - c < PAIRS_PANEL ? g->in - c : PAIRS_PANEL;

        if (has)
            __builtin_prefetch((const char *)in +
                               (a + c + g->w * g->in_row) * size, 0, 2);
        wgrad_lay_out(to + c, in, has, a + c, more, b + c, some, half);
    }
}

/* Row y of the input, or of zeros above and below it, as pairs. */
VEC_INLINE void wgrad_lay_out_input(uint32_t *to, const void *in,
                                    const struct wgrad *g, ptrdiff_t y,
                                    const bool half)
{
    const bool has = y >= 0 && y < (ptrdiff_t)g->h;
    const size_t n = has ? wgrad_row_length((size_t)y, g->w, g->in_pixels)
                         : 0;
    const size_t row = has ? (size_t)y * g->w * g->in_row : 0;

    for (size_t k = 0; k < g->pairs; k++, to += g->ld)
        for (size_t kx = 0; kx < g->kernel; kx++)
            wgrad_lay_out_pair(to + kx * g->in, in, row, g,
                               (ptrdiff_t)(2 * k * g->stride + kx) -
                                   (ptrdiff_t)g->left, (ptrdiff_t)n, half);
}

/* dw (kernel*in,wide) += the sum over K pairs. */
VEC_INLINE void wgrad_multiply(float *dw, const uint32_t *x, const uint32_t *d,
                               size_t panel, size_t K, const struct wgrad *g)
{
    const size_t M = g->kernel * g->in;

    for (size_t n = 0; n < g->wide; n += 2 * PAIRS_PANEL)
        for (size_t m = 0; m < M; m += PAIRS_ROWS) {
            const size_t rows = M - m < PAIRS_ROWS ? M - m : PAIRS_ROWS;
            const uint32_t *b = d + n / PAIRS_PANEL * panel;
            float *to = dw + m * g->wide + n;

            if (n + PAIRS_PANEL < g->wide)
                pairs_block(to, g->wide, rows, 2 * PAIRS_PANEL, x + m, 1,
                            g->ld, b, panel, K, true, PAIRS_WIDE);
            else
                pairs_block(to, g->wide, rows, PAIRS_PANEL, x + m, 1, g->ld,
                            b, panel, K, true, PAIRS_WIDE / 2);
        }
}

/* The pairs of `rows` rows of the gradient from y on. */
static void wgrad_gradients(uint32_t *d, size_t panel, const void *dout,
                            const struct wgrad *g, size_t y, size_t rows)
{
    for (size_t r = 0; r < rows; r++) {
        uint32_t *to = d + r * g->pairs * PAIRS_PANEL;

        if (g->half_out)
            wgrad_lay_out_gradient(to, panel, dout, g, y + r, true);
        else
            wgrad_lay_out_gradient(to, panel, dout, g, y + r, false);
    }
}

/* The pairs of `rows` rows of the input, from y on by the stride. */
static void wgrad_inputs(uint32_t *x, const void *in, const struct wgrad *g,
                         ptrdiff_t y, size_t rows)
{
    for (size_t j = 0; j < rows; j++) {
        uint32_t *to = x + j * g->pairs * g->ld;
        const ptrdiff_t at = y + (ptrdiff_t)(j * g->stride);

        if (g->half_in)
            wgrad_lay_out_input(to, in, g, at, true);
        else
            wgrad_lay_out_input(to, in, g, at, false);
    }
}

/* dw (kernel,kernel*in,wide) += what rows y to y + rows of an image's output
 * give; room: g->words words. */
void ISA(wgrad_rows)(float *dw, const void *dout, const void *in,
                     uint32_t *room, const struct wgrad *g, size_t y,
                     size_t rows)
{
    const size_t panel = rows * g->pairs * PAIRS_PANEL;
    const size_t line = g->pairs * g->ld;
    uint32_t *d = room, *x = room + g->wide / PAIRS_PANEL * panel;

    wgrad_gradients(d, panel, dout, g, y, rows);
    for (size_t q = 0; q < g->stride && q < g->kernel; q++) {
        wgrad_inputs(x, in, g, (ptrdiff_t)(y * g->stride + q) -
                                   (ptrdiff_t)g->top, wgrad_seen(g, q, rows));
        for (size_t ky = q; ky < g->kernel; ky += g->stride)
            for (size_t r = 0; r < rows; r += g->few) {
                const size_t n = rows - r < g->few ? rows - r : g->few;

                wgrad_multiply(dw + ky * g->kernel * g->in * g->wide,
                               x + (ky / g->stride + r) * line,
                               d + r * g->pairs * PAIRS_PANEL, panel,
                               n * g->pairs, g);
            }
    }
}
