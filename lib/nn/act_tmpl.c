/* Activations over contiguous values. */
#include "lib/nn/kernels.h"
#include "lib/nn/math.h"
#include "lib/nn/vector.h"

/* math_act and math_slope, to the bit, of a vector. */
VEC_INLINE vf act_of(vf x, int act)
{
    vf t;

    switch (act) {
    case ACT_RELU:
        return vf_max(x, vf_set(0));
    case ACT_LRELU:
        return vf_max(x, ACT_SLOPE * x);
    case ACT_HARDSWISH:
    case ACT_HARDSIGMOID:
        t = vf_min(vf_set(6), vf_max(vf_set(0), x + 3));
        return act == ACT_HARDSWISH ? x * t * (1.0f / 6) : t * (1.0f / 6);
    case ACT_SIGMOID:
        return vf_sigmoid(x);
    case ACT_TANH:
        return vf_tanh(x);
    case ACT_GELU_TANH:
        return x * vf_sigmoid(x * (vf_set((float)ACT_GELU_A) +
                                   (float)ACT_GELU_B * x * x));
    case ACT_SILU:
        return x * vf_sigmoid(x);
    default:
        return x;
    }
}

/* math_slope, to the bit, of a vector. */
VEC_INLINE vf act_slope_of(vf x, int act)
{
    const vf zero = vf_set(0), one = vf_set(1);
    vf in, y, t;

    switch (act) {
    case ACT_RELU:
        return vf_sel(vf_gt(x, vf_set(0)), one, zero);
    case ACT_LRELU:
        return vf_sel(vf_gt(x, vf_set(0)), one, vf_set(ACT_SLOPE));
    case ACT_HARDSWISH:
        in = vf_sel(vf_gt(x, vf_set(-3)), (2 * x + 3) * (1.0f / 6), zero);
        return vf_sel(vf_gt(vf_set(3), x), in, one);
    case ACT_HARDSIGMOID:
        in = vf_sel(vf_gt(x, vf_set(-3)), vf_set(1.0f / 6), zero);
        return vf_sel(vf_gt(vf_set(3), x), in, zero);
    case ACT_SIGMOID:
        y = vf_sigmoid(x);
        return y * (1 - y);
    case ACT_TANH:
        y = vf_tanh(x);
        return 1 - y * y;
    case ACT_GELU_TANH:
        t = vf_set((float)ACT_GELU_A) + 3 * (float)ACT_GELU_B * x * x;
        y = vf_sigmoid(x * (vf_set((float)ACT_GELU_A) +
                            (float)ACT_GELU_B * x * x));
        return y + x * y * (1 - y) * t;
    case ACT_SILU:
        y = vf_sigmoid(x);
        return y + x * y * (1 - y);
    default:
        return one;
    }
}

/* How many values the vectors above serve: gelu's erf is the C library's. */
static size_t act_whole(int act, size_t n)
{
    return act == ACT_GELU ? 0 : n / VEC * VEC;
}

void ISA(act_forward)(float *y, const float *x, int act, size_t n)
{
    size_t whole = act_whole(act, n);
#define LOOP(A)                                                              \
    for (size_t i = 0; i < whole; i += VEC)                             \
        vf_store(y + i, act_of(vf_load(x + i), A));                          \
    for (size_t i = whole; i < n; i++)                                       \
        y[i] = math_act(x[i], A);
    MATH_FOR_ACT(act, LOOP)
#undef LOOP
}

void ISA(act_backward)(float *dx, const float *dy, const float *x, int act,
                       size_t n)
{
    size_t whole = act_whole(act, n);
#define LOOP(A)                                                              \
    for (size_t i = 0; i < whole; i += VEC)                             \
        vf_store(dx + i,                                                     \
                 vf_load(dy + i) * act_slope_of(vf_load(x + i), A));         \
    for (size_t i = whole; i < n; i++)                                       \
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
        sum[c] = 0;
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

/* The same of bfloat16, which relu's slope leaves as it is or clears. */
void ISA(act_sums_half)(float *sum, uint16_t *dout, const uint16_t *out,
                        int act, size_t rows, size_t C)
{
    for (size_t c = 0; c < C; c++)
        sum[c] = 0;
    for (size_t r = 0; r < rows; r++) {
        uint16_t *restrict d = dout + r * C;
        const uint16_t *restrict y = out + r * C;
        float *restrict s = sum;

        /* positive: neither the sign's bit, nor none at all */
        for (size_t c = 0; act == ACT_RELU && c < C; c++)
            d[c] = (int16_t)y[c] > 0 ? d[c] : 0;
        for (size_t c = 0; c < C; c++) {
            union { uint32_t u; float f; } v = { (uint32_t)d[c] << 16 };

            s[c] += v.f;
        }
    }
}
