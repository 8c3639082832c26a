/* Small products with per-channel vectors. */
#include "lib/nn/kernels.h"
#include "lib/nn/vector.h"

/* y (out) = W (out,in) x + b; b may be NULL. */
void ISA(gemv)(float *y, const float *w, const float *x, const float *b,
               size_t out, size_t in)
{
    size_t whole = in / 16 * 16;

    for (size_t o = 0; o < out; o++) {
        const float *row = w + o * in;

        vf acc[VEC_PARTS] = { { 0 } };
        float lane[16], sum = b ? b[o] : 0;
        for (size_t i = 0; i < whole; i += 16)
            for (size_t j = 0; j < VEC_PARTS; j++)
                acc[j] += vf_load(row + i + VEC * j) *
                          vf_load(x + i + VEC * j);
        for (size_t j = 0; j < VEC_PARTS; j++)
            vf_store(lane + VEC * j, acc[j]);
        for (size_t i = 0; i < 16; i++)
            sum += lane[i];
        for (size_t i = whole; i < in; i++)
            sum += row[i] * x[i];
        y[o] = sum;
    }
}

/* One output's share of y = W x backward: dw += dy x, dx += dy w. */
void ISA(outer_backward)(float *dw, float *dx, const float *w, const float *x,
                         float dy, size_t n)
{
    KERNEL_INDEPENDENT
    for (size_t i = 0; i < n; i++) {
        dw[i] += dy * x[i];
        dx[i] += dy * w[i];
    }
}

/* Summed in double precision. */
double ISA(dot)(const float *a, const float *b, size_t n)
{
    double lane[16] = { 0 }, sum = 0;
    size_t whole = n / 16 * 16;

    for (size_t i = 0; i < whole; i += 16)
        for (size_t j = 0; j < 16; j++)
            lane[j] += (double)a[i + j] * (double)b[i + j];
    for (size_t j = 0; j < 16; j++)
        sum += lane[j];
    for (size_t i = whole; i < n; i++)
        sum += (double)a[i] * (double)b[i];
    return sum;
}

/* y = x gate + add, rows of C; add may be NULL. */
void ISA(channel_scale)(float *y, const float *x, const float *gate,
                        const float *add, size_t rows, size_t C)
{
    for (size_t r = 0; r < rows; r++) {
        const float *p = x + r * C;
        float *q = y + r * C;

        if (add)
            KERNEL_INDEPENDENT
            for (size_t c = 0; c < C; c++)
                q[c] = p[c] * gate[c] + add[c];
        else
            KERNEL_INDEPENDENT
            for (size_t c = 0; c < C; c++)
                q[c] = p[c] * gate[c];
    }
}

/* sum (C) = column sums of a b. */
void ISA(channel_dot)(float *sum, const float *a, const float *b, size_t rows,
                      size_t C)
{
    float *restrict s = sum;

    for (size_t c = 0; c < C; c++)
        s[c] = 0;
    for (size_t r = 0; r < rows; r++)
        for (size_t c = 0; c < C; c++)
            s[c] += a[r * C + c] * b[r * C + c];
}
