/* Elementwise work on feature images, split over threads in chunks of a fixed
 * size. */
#include "lib/nn/image.h"

#include <string.h>

#include "lib/nn/act.h"
#include "lib/nn/kernels.h"

#define CHUNK 16384

void image_add(float *y, const float *x, size_t n)
{
    const struct nn_kernels *k = nn_kernels();
#pragma omp parallel for schedule(static) if (n > CHUNK)
    for (size_t i = 0; i < n; i += CHUNK)
        k->add(y + i, x + i, n - i < CHUNK ? n - i : CHUNK);
}

void image_to_bf16(uint16_t *y, const float *x, size_t n)
{
    const struct nn_kernels *k = nn_kernels();
#pragma omp parallel for schedule(static) if (n > CHUNK)
    for (size_t i = 0; i < n; i += CHUNK)
        k->to_bf16(y + i, x + i, n - i < CHUNK ? n - i : CHUNK);
}

void image_round_bf16(float *y, const float *x, size_t n)
{
    const struct nn_kernels *k = nn_kernels();
#pragma omp parallel for schedule(static) if (n > CHUNK)
    for (size_t i = 0; i < n; i += CHUNK)
        k->round_bf16(y + i, x + i, n - i < CHUNK ? n - i : CHUNK);
}

void sft_forward(float *y, const float *x, const float *st, float one,
                 size_t rows, size_t C)
{
    const struct nn_kernels *k = nn_kernels();
    size_t step = CHUNK / C + 1;
#pragma omp parallel for schedule(static) if (rows > step)
    for (size_t r = 0; r < rows; r += step)
        k->sft_forward(y + r * C, x + r * C, st + 2 * r * C, one,
                       rows - r < step ? rows - r : step, C);
}

void sft_backward(float *dx, float *dst, const float *dy, const float *x,
                  const float *st, float one, size_t rows, size_t C)
{
    const struct nn_kernels *k = nn_kernels();
    size_t step = CHUNK / C + 1;
#pragma omp parallel for schedule(static) if (rows > step)
    for (size_t r = 0; r < rows; r += step)
        k->sft_backward(dx + r * C, dst + 2 * r * C, dy + r * C, x + r * C,
                        st + 2 * r * C, one,
                        rows - r < step ? rows - r : step, C);
}

void concat_forward(float *out, const float *a, const float *b, size_t rows,
                    size_t A, size_t Bc, size_t C, size_t group)
{
#pragma omp parallel for schedule(static)
    for (size_t r = 0; r < rows; r++) {
        float *to = out + r * C;

        if (a)
            memcpy(to, a + r * A, A * sizeof *to);
        memcpy(to + A, b + r / group * Bc, Bc * sizeof *to);
        memset(to + A + Bc, 0, (C - A - Bc) * sizeof *to);
    }
}

void concat_backward(float *da, float *db, const float *dout, size_t rows,
                     size_t A, size_t Bc, size_t C, size_t group)
{
    if (da) {
#pragma omp parallel for schedule(static)
        for (size_t r = 0; r < rows; r++)
            memcpy(da + r * A, dout + r * C, A * sizeof *da);
    }
    if (!db)
        return;
#pragma omp parallel for schedule(static)
    for (size_t c = 0; c < Bc; c++)
        for (size_t g = 0; g < rows / group; g++) {
            double sum = 0;

            for (size_t r = g * group; r < (g + 1) * group; r++)
                sum += (double)dout[r * C + A + c];
            db[g * Bc + c] += (float)sum;
        }
}

void concat_rows(float *out, const float *a, const float *b, size_t rows,
                 size_t A, size_t Bc, size_t C)
{
    concat_forward(out, a, b, rows, A, Bc, C, 1);
}

void concat_rows_backward(float *db, const float *dout, size_t rows, size_t A,
                          size_t Bc, size_t C)
{
#pragma omp parallel for schedule(static)
    for (size_t r = 0; r < rows; r++)
        memcpy(db + r * Bc, dout + r * C + A, Bc * sizeof *db);
}

void relu_copy(float *y, const float *x, size_t n)
{
    act_forward(y, x, ACT_RELU, n);
}

void relu_add_backward(float *dx, const float *dy, const float *y, size_t n)
{
#pragma omp parallel for schedule(static)
    for (size_t i = 0; i < n; i++)
        if (y[i] > 0.0f)
            dx[i] += dy[i];
}

void space_to_depth(float *out, const float *in, const float *mean,
                    float scale, size_t B, size_t h, size_t w, size_t C,
                    size_t f)
{
    size_t oh = h / f, ow = w / f, row = f * f * C;
#pragma omp parallel for collapse(2) schedule(static)
    for (size_t n = 0; n < B; n++)
        for (size_t y = 0; y < oh; y++)
            for (size_t x = 0; x < ow; x++) {
                float *to = out + ((n * oh + y) * ow + x) * row;

                for (size_t dy = 0; dy < f; dy++) {
                    const float *p = in + ((n * h + y * f + dy) * w + x * f) *
                                              C;

                    for (size_t i = 0; i < f * C; i++)
                        to[dy * f * C + i] =
                            (p[i] - (mean ? mean[i % C] : 0.0f)) * scale;
                }
            }
}

void depth_to_space(float *out, const float *in, size_t B, size_t h, size_t w,
                    size_t C, size_t f)
{
#pragma omp parallel for collapse(2) schedule(static)
    for (size_t n = 0; n < B; n++)
        for (size_t y = 0; y < h * f; y++) {
            const float *p = in + ((n * h + y / f) * w * f + y % f) * f * C;
            float *to = out + (n * h * f + y) * w * f * C;

            for (size_t x = 0; x < w; x++, p += f * f * C, to += f * C)
                memcpy(to, p, f * C * sizeof *to);
        }
}

void depth_to_space_add(float *out, const float *base, size_t base_C,
                        const float *in, size_t B, size_t h, size_t w,
                        size_t C, size_t f)
{
#pragma omp parallel for collapse(2) schedule(static)
    for (size_t n = 0; n < B; n++)
        for (size_t y = 0; y < h * f; y++) {
            const float *p = in + ((n * h + y / f) * w * f + y % f) * f * C;
            const float *b = base + (n * h * f + y) * w * f * base_C;
            float *to = out + (n * h * f + y) * w * f * C;

            for (size_t x = 0; x < w; x++, p += f * f * C)
                for (size_t i = 0; i < f; i++, b += base_C, to += C)
                    for (size_t c = 0; c < C; c++)
                        to[c] = b[c] + p[i * C + c];
        }
}

void depth_to_space_backward(float *din, const float *dout, size_t B,
                             size_t h, size_t w, size_t C, size_t f)
{
#pragma omp parallel for collapse(2) schedule(static)
    for (size_t n = 0; n < B; n++)
        for (size_t y = 0; y < h * f; y++) {
            float *p = din + ((n * h + y / f) * w * f + y % f) * f * C;
            const float *g = dout + (n * h * f + y) * w * f * C;

            for (size_t x = 0; x < w; x++, p += f * f * C, g += f * C)
                memcpy(p, g, f * C * sizeof *p);
        }
}
