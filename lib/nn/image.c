/* Elementwise work on feature images, split over threads in chunks of a fixed
 * size. */
#include "lib/nn/image.h"

#include <string.h>

#include "lib/base/parallel.h"
#include "lib/nn/kernels.h"

#define CHUNK 16384

/* One chunk. */
PARALLEL(image_add_part, part, float *, y, const float *, x, size_t, n)
{
    size_t i = part * CHUNK;

    nn_kernels()->add(y + i, x + i, n - i < CHUNK ? n - i : CHUNK);
}

void image_add(float *y, const float *x, size_t n)
{
    parallel_each(image_add_part, (n + CHUNK - 1) / CHUNK, 1, y, x, n);
}

/* One chunk. */
PARALLEL(image_to_bf16_part, part, uint16_t *, y, const float *, x, size_t, n)
{
    size_t i = part * CHUNK;

    nn_kernels()->to_bf16(y + i, x + i, n - i < CHUNK ? n - i : CHUNK);
}

void image_to_bf16(uint16_t *y, const float *x, size_t n)
{
    parallel_each(image_to_bf16_part, (n + CHUNK - 1) / CHUNK, 1, y, x, n);
}

/* One chunk. */
PARALLEL(sft_forward_part, part, float *, y, const float *, x,
         const float *, st, size_t, C, size_t, rows, size_t, step, float, one)
{
    size_t r = part * step;

    nn_kernels()->sft_forward(y + r * C, x + r * C, st + 2 * r * C, one,
                              rows - r < step ? rows - r : step, C);
}

void sft_forward(float *y, const float *x, const float *st, float one,
                 size_t rows, size_t C)
{
    size_t step = CHUNK / C + 1;

    parallel_each(sft_forward_part, (rows + step - 1) / step, 1, y, x, st, C,
                  rows, step, one);
}

/* One chunk. */
PARALLEL(sft_backward_part, part, float *, dx, float *, dst, const float *, dy,
         const float *, x, const float *, st, size_t, C, size_t, rows,
         size_t, step, float, one)
{
    size_t r = part * step;

    nn_kernels()->sft_backward(dx + r * C, dst + 2 * r * C, dy + r * C,
                               x + r * C, st + 2 * r * C, one,
                               rows - r < step ? rows - r : step, C);
}

void sft_backward(float *dx, float *dst, const float *dy, const float *x,
                  const float *st, float one, size_t rows, size_t C)
{
    size_t step = CHUNK / C + 1;

    parallel_each(sft_backward_part, (rows + step - 1) / step, 1, dx, dst, dy,
                  x, st, C, rows, step, one);
}

/* One row. */
PARALLEL(concat_forward_part, r, float *, out, const float *, a,
         const float *, b, size_t, C, size_t, A, size_t, group, size_t, Bc)
{
    float *to = out + r * C;

    if (a)
        memcpy(to, a + r * A, A * sizeof *to);
    memcpy(to + A, b + r / group * Bc, Bc * sizeof *to);
    memset(to + A + Bc, 0, (C - A - Bc) * sizeof *to);
}

void concat_forward(float *out, const float *a, const float *b, size_t rows,
                    size_t A, size_t Bc, size_t C, size_t group)
{
    parallel_each(concat_forward_part, rows, 1, out, a, b, C, A, group, Bc);
}

/* One row. */
PARALLEL(concat_take_part, r, float *, part, const float *, dout, size_t, at,
         size_t, n, size_t, C)
{
    memcpy(part + r * n, dout + r * C + at, n * sizeof *part);
}

void concat_take(float *part, const float *dout, size_t rows, size_t at,
                 size_t n, size_t C)
{
    parallel_each(concat_take_part, rows, 1, part, dout, at, n, C);
}

PARALLEL(concat_backward_channel, c, const float *, dout, float *, db,
         size_t, rows, size_t, group, size_t, C, size_t, A, size_t, Bc)
{
    for (size_t g = 0; g < rows / group; g++) {
        double sum = 0;

        for (size_t r = g * group; r < (g + 1) * group; r++)
            sum += (double)dout[r * C + A + c];
        db[g * Bc + c] += (float)sum;
    }
}

void concat_backward(float *da, float *db, const float *dout, size_t rows,
                     size_t A, size_t Bc, size_t C, size_t group)
{
    if (da)
        concat_take(da, dout, rows, 0, A, C);
    if (!db)
        return;

    parallel_each(concat_backward_channel, Bc, 1, dout, db, rows, group, C, A,
                  Bc);
}

PARALLEL(space_to_depth_part, k, float *, out, const float *, in, size_t, h,
         size_t, f, size_t, w, size_t, C)
{
    size_t n = k / h, y = k % h;
    const float *p = in + (n * h + y) * w * C;
    float *to = out + ((n * h + y) / f * (w / f) * f + y % f) * f * C;

    for (size_t x = 0; x < w; x += f, p += f * C, to += f * f * C)
        memcpy(to, p, f * C * sizeof *to);
}

void space_to_depth(float *out, const float *in, size_t B, size_t h, size_t w,
                    size_t C, size_t f)
{
    parallel_each(space_to_depth_part, B * h, 1, out, in, h, f, w, C);
}

PARALLEL(depth_to_space_part, k, const float *, in, float *, out, size_t, h,
         size_t, f, size_t, w, size_t, C)
{
    size_t n = k / (h * f), y = k % (h * f);
    const float *p = in + ((n * h + y / f) * w * f + y % f) * f * C;
    float *to = out + (n * h * f + y) * w * f * C;

    for (size_t x = 0; x < w; x++, p += f * f * C, to += f * C)
        memcpy(to, p, f * C * sizeof *to);
}

void depth_to_space(float *out, const float *in, size_t B, size_t h, size_t w,
                    size_t C, size_t f)
{
    parallel_each(depth_to_space_part, B * (h * f), 1, in, out, h, f, w, C);
}

PARALLEL(depth_to_space_add_part, k, const float *, in, const float *, base,
         float *, out, size_t, h, size_t, f, size_t, w, size_t, C,
         size_t, base_C)
{
    size_t n = k / (h * f), y = k % (h * f);
    const float *p = in + ((n * h + y / f) * w * f + y % f) * f * C;
    const float *b = base + (n * h * f + y) * w * f * base_C;
    float *to = out + (n * h * f + y) * w * f * C;

    for (size_t x = 0; x < w; x++, p += f * f * C)
        for (size_t i = 0; i < f; i++, b += base_C, to += C)
            for (size_t c = 0; c < C; c++)
                to[c] = b[c] + p[i * C + c];
}

void depth_to_space_add(float *out, const float *base, size_t base_C,
                        const float *in, size_t B, size_t h, size_t w,
                        size_t C, size_t f)
{
    parallel_each(depth_to_space_add_part, B * (h * f), 1, in, base, out, h, f,
                  w, C, base_C);
}
