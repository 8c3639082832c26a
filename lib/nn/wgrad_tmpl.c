/* The weights' gradient of a convolution by products of pairs (pairs.h): the
 * sum over pixels of input times gradient, for every row of the kernel.  What
 * the kernel's columns see of a row of the input stands side by side. */
#include "lib/nn/kernels.h"
#include "lib/nn/pairs.h"
#include "lib/nn/wgrad.h"

static const float wgrad_zero[PAIRS_PANEL];

/* Values of row y, of `row` pixels each, of an image of so many pixels. */
VF_INLINE size_t wgrad_row_length(size_t y, size_t row, size_t pixels)
{
    return pixels - y * row < row ? pixels - y * row : row;
}

/* Row y of the gradient as panels of pairs, `panel` words apart.  The row after
 * it is on its way from memory meanwhile, which takes longer than the work. */
VF_INLINE void wgrad_lay_out_gradient(uint32_t *to, size_t panel,
                                      const float *dout,
                                      const struct wgrad *g, size_t y)
{
    const size_t n = wgrad_row_length(y, g->ow, g->out_pixels);
    const float *row = dout + y * g->ow * g->out;

    for (size_t k = 0; k < g->pairs; k++)
        for (size_t o = 0; o < g->out; o += PAIRS_PANEL) {
            const size_t some = g->out - o < PAIRS_PANEL ? g->out - o
                                                         : PAIRS_PANEL;
            const float *a = row + 2 * k * g->out + o;

            __builtin_prefetch(a + g->ow * g->out, 0, 2);
            __builtin_prefetch(a + (g->ow + 1) * g->out, 0, 2);
            pairs_round_rows(to + o / PAIRS_PANEL * panel + k * PAIRS_PANEL,
                             2 * k < n ? a : wgrad_zero,
                             2 * k + 1 < n ? a + g->out : wgrad_zero,
                             2 * k < n ? some : PAIRS_PANEL);
        }
}

/* in channels of the pixels at x and x + stride of a row of n, zeros beside
 * it.  The next row's are asked for. */
VF_INLINE void wgrad_lay_out_pair(uint32_t *to, const float *row,
                                  const struct wgrad *g, ptrdiff_t x,
                                  ptrdiff_t n)
{
    const ptrdiff_t next = x + (ptrdiff_t)g->stride;
    const ptrdiff_t step = (ptrdiff_t)g->in_row;
    const bool has = x >= 0 && x < n, more = next >= 0 && next < n;

    for (size_t c = 0; c < g->in; c += PAIRS_PANEL) {
        const size_t some = g->in - c < PAIRS_PANEL ? g->in - c : PAIRS_PANEL;

        const ptrdiff_t at = (ptrdiff_t)c;

        __builtin_prefetch(row + at + (x + (ptrdiff_t)g->w) * step, 0, 2);
        pairs_round_rows(to + c, has ? row + at + x * step : wgrad_zero,
                         more ? row + at + next * step : wgrad_zero, some);
    }
}

/* Row y of the input, or of zeros above and below it, as pairs. */
VF_INLINE void wgrad_lay_out_input(uint32_t *to, const float *in,
                                   const struct wgrad *g, ptrdiff_t y)
{
    const bool has = y >= 0 && y < (ptrdiff_t)g->h;
    const size_t n = has ? wgrad_row_length((size_t)y, g->w, g->in_pixels)
                         : 0;
    const float *row = has ? in + (size_t)y * g->w * g->in_row : in;

    for (size_t k = 0; k < g->pairs; k++, to += g->ld)
        for (size_t kx = 0; kx < g->kernel; kx++)
            wgrad_lay_out_pair(to + kx * g->in, row, g,
                               (ptrdiff_t)(2 * k * g->stride + kx) -
                                   (ptrdiff_t)g->left, (ptrdiff_t)n);
}

/* dw (kernel*in,wide) += the sum over K pairs. */
VF_INLINE void wgrad_multiply(float *dw, const uint32_t *x, const uint32_t *d,
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

/* dw (kernel,kernel*in,wide) += what rows y to y + rows of an image's output
 * give; room: g->words words. */
void ISA(wgrad_rows)(float *dw, const float *dout, const float *in,
                     uint32_t *room, const struct wgrad *g, size_t y,
                     size_t rows)
{
    const size_t panel = rows * g->pairs * PAIRS_PANEL;
    const size_t line = g->pairs * g->ld;
    uint32_t *d = room, *x = room + g->wide / PAIRS_PANEL * panel;

    for (size_t r = 0; r < rows; r++)
        wgrad_lay_out_gradient(d + r * g->pairs * PAIRS_PANEL, panel, dout, g,
                               y + r);
    for (size_t q = 0; q < g->stride && q < g->kernel; q++) {
        const size_t seen = wgrad_seen(g, q, rows);

        for (size_t j = 0; j < seen; j++)
            wgrad_lay_out_input(x + j * line, in, g,
                                (ptrdiff_t)((y + j) * g->stride + q) -
                                    (ptrdiff_t)g->top);
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
