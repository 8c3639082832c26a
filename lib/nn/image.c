/* Elementwise work on feature images, split over threads in chunks of a fixed
 * size. */
#include "lib/nn/image.h"

#include <string.h>

#include "lib/base/parallel.h"
#include "lib/nn/act.h"
#include "lib/nn/kernels.h"

#define CHUNK 16384

/* One chunk. */
PARALLEL(image_add_part, part, const struct nn_kernels *, k, float *, y,
         const float *, x, size_t, n)
{
    size_t i = part * CHUNK;

    k->add(y + i, x + i, n - i < CHUNK ? n - i : CHUNK);
}

void image_add(float *y, const float *x, size_t n)
{
    const struct nn_kernels *k = nn_kernels();

    parallel_each(image_add_part, (n + CHUNK - 1) / CHUNK, 1, k, y, x, n);
}

/* One chunk. */
PARALLEL(image_to_bf16_part, part, const struct nn_kernels *, k, uint16_t *, y,
         const float *, x, size_t, n)
{
    size_t i = part * CHUNK;

    k->to_bf16(y + i, x + i, n - i < CHUNK ? n - i : CHUNK);
}

void image_to_bf16(uint16_t *y, const float *x, size_t n)
{
    const struct nn_kernels *k = nn_kernels();

    parallel_each(image_to_bf16_part, (n + CHUNK - 1) / CHUNK, 1, k, y, x, n);
}

/* One chunk. */
PARALLEL(sft_forward_part, part, const struct nn_kernels *, k, float *, y,
         const float *, x, const float *, st, size_t, C, size_t, rows,
         size_t, step, float, one)
{
    size_t r = part * step;

    k->sft_forward(y + r * C, x + r * C, st + 2 * r * C, one,
                   rows - r < step ? rows - r : step, C);
}

void sft_forward(float *y, const float *x, const float *st, float one,
                 size_t rows, size_t C)
{
    const struct nn_kernels *k = nn_kernels();
    size_t step = CHUNK / C + 1;

    parallel_each(sft_forward_part, (rows + step - 1) / step, 1, k, y, x, st, C,
                  rows, step, one);
}

/* One chunk. */
PARALLEL(sft_backward_part, part, const struct nn_kernels *, k, float *, dx,
         float *, dst, const float *, dy, const float *, x, const float *, st,
         size_t, C, size_t, rows, size_t, step, float, one)
{
    size_t r = part * step;

    k->sft_backward(dx + r * C, dst + 2 * r * C, dy + r * C, x + r * C,
                    st + 2 * r * C, one, rows - r < step ? rows - r : step, C);
}

void sft_backward(float *dx, float *dst, const float *dy, const float *x,
                  const float *st, float one, size_t rows, size_t C)
{
    const struct nn_kernels *k = nn_kernels();
    size_t step = CHUNK / C + 1;

    parallel_each(sft_backward_part, (rows + step - 1) / step, 1, k, dx, dst,
                  dy, x, st, C, rows, step, one);
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
PARALLEL(concat_backward_part, r, float *, da, const float *, dout, size_t, A,
         size_t, C)
{
    memcpy(da + r * A, dout + r * C, A * sizeof *da);
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
    if (da) {

        parallel_each(concat_backward_part, rows, 1, da, dout, A, C);
    }
    if (!db)
        return;

    parallel_each(concat_backward_channel, Bc, 1, dout, db, rows, group, C, A,
                  Bc);
}

void concat_rows(float *out, const float *a, const float *b, size_t rows,
                 size_t A, size_t Bc, size_t C)
{
    concat_forward(out, a, b, rows, A, Bc, C, 1);
}

/* One row. */
PARALLEL(concat_rows_backward_part, r, float *, db, const float *, dout,
         size_t, Bc, size_t, C, size_t, A)
{
    memcpy(db + r * Bc, dout + r * C + A, Bc * sizeof *db);
}

void concat_rows_backward(float *db, const float *dout, size_t rows, size_t A,
                          size_t Bc, size_t C)
{
    parallel_each(concat_rows_backward_part, rows, 1, db, dout, Bc, C, A);
}

void relu_copy(float *y, const float *x, size_t n)
{
    act_forward(y, x, ACT_RELU, n);
}

PARALLEL(relu_add_backward_part, i, const float *, y, const float *, dy,
         float *, dx)
{
    if (y[i] > 0.0f)
        dx[i] += dy[i];
}

void relu_add_backward(float *dx, const float *dy, const float *y, size_t n)
{
    parallel_each(relu_add_backward_part, n, 1, y, dy, dx);
}

PARALLEL(space_to_depth_part, k, float *, out, const float *, in,
         const float *, mean, size_t, ow, size_t, oh, size_t, row, size_t, f,
         size_t, h, size_t, w, size_t, C, float, scale)
{
    size_t n = k / oh, y = k % oh;

    for (size_t x = 0; x < ow; x++) {
        float *to = out + ((n * oh + y) * ow + x) * row;

        for (size_t dy = 0; dy < f; dy++) {
            const float *p = in + ((n * h + y * f + dy) * w + x * f) * C;

            for (size_t i = 0; i < f * C; i++)
                to[dy * f * C + i] =
                    (p[i] - (mean ? mean[i % C] : 0.0f)) * scale;
        }
    }
}

void space_to_depth(float *out, const float *in, const float *mean,
                    float scale, size_t B, size_t h, size_t w, size_t C,
                    size_t f)
{
    size_t oh = h / f, ow = w / f, row = f * f * C;

    parallel_each(space_to_depth_part, B * oh, 1, out, in, mean, ow, oh, row, f,
                  h, w, C, scale);
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

PARALLEL(depth_to_space_backward_part, k, float *, din, const float *, dout,
         size_t, h, size_t, f, size_t, w, size_t, C)
{
    size_t n = k / (h * f), y = k % (h * f);
    float *p = din + ((n * h + y / f) * w * f + y % f) * f * C;
    const float *g = dout + (n * h * f + y) * w * f * C;

    for (size_t x = 0; x < w; x++, p += f * f * C, g += f * C)
        memcpy(p, g, f * C * sizeof *p);
}

void depth_to_space_backward(float *din, const float *dout, size_t B,
                             size_t h, size_t w, size_t C, size_t f)
{
    parallel_each(depth_to_space_backward_part, B * (h * f), 1, din, dout, h, f,
                  w, C);
}
