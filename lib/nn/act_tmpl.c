/* Activations over contiguous values. */
#include "lib/nn/kernels.h"
#include "lib/nn/math.h"

void ISA(act_forward)(float *y, const float *x, int act, size_t n)
{
#define LOOP(A)                                                              \
    for (size_t i = 0; i < n; i++)                                           \
        y[i] = math_act(x[i], A);
    MATH_FOR_ACT(act, LOOP)
#undef LOOP
}

void ISA(act_backward)(float *dx, const float *dy, const float *x, int act,
                       size_t n)
{
#define LOOP(A)                                                              \
    for (size_t i = 0; i < n; i++)                                           \
        dx[i] = dy[i] * math_slope(x[i], A);
    MATH_FOR_ACT(act, LOOP)
#undef LOOP
}

void ISA(act_backward_out)(float *dx, const float *dy, const float *y,
                           int act, size_t n)
{
#define LOOP(A)                                                              \
    for (size_t i = 0; i < n; i++)                                           \
        dx[i] = dy[i] * math_slope_out(y[i], A);
    MATH_FOR_ACT(act, LOOP)
#undef LOOP
}

/* sum (C) = column sums of dout (rows,C), after dout *= act'(out). */
void ISA(act_sums)(float *sum, float *dout, const float *out, int act,
                   size_t rows, size_t C)
{
    for (size_t c = 0; c < C; c++)
        sum[c] = 0.0f;
#define LOOP(A)                                                              \
    for (size_t r = 0; r < rows; r++) {                                      \
        float *restrict d = dout + r * C;                                    \
        const float *restrict y = out + r * C;                               \
        float *restrict s = sum;                                             \
        for (size_t c = 0; c < C; c++) {                                     \
            d[c] *= math_slope_out(y[c], A);                                 \
            s[c] += d[c];                                                    \
        }                                                                    \
    }
    if (act == ACT_NONE) {
        for (size_t r = 0; r < rows; r++)
            for (size_t c = 0; c < C; c++)
                sum[c] += dout[r * C + c];
    } else {
        MATH_FOR_ACT(act, LOOP)
    }
#undef LOOP
}
