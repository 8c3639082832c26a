/* Elementary functions as plain arithmetic, so that loops over them become
 * vector code.  Private to lib/nn's kernels. */
#ifndef SPID_NN_MATH_H
#define SPID_NN_MATH_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "lib/nn/act.h"

/* p = e^r for |r| <= ln 2 / 2, once p holds 1.9875691500e-4; floats or vectors
 * of them. */
#define MATH_EXP_SERIES(p, r)                                                \
    do {                                                                     \
        p = p * r + 1.3981999507e-3f;                                        \
        p = p * r + 8.3334519073e-3f;                                        \
        p = p * r + 4.1665795894e-2f;                                        \
        p = p * r + 1.6666665459e-1f;                                        \
        p = p * r + 5.0000001201e-1f;                                        \
        p = p * r * r + r + 1.0f;                                            \
    } while (0)

/* e^x to 2 units in the last place; saturates at +-87. */
static inline float math_exp(float x)
{
    x = x < -87 ? -87 : x;
    x = x > 87 ? 87 : x;
    /* 1.5 * 2^23: adding it rounds to an integer */
    float magic = 12582912;
    float n = (x * 1.44269504f + magic) - magic;
    float r = (x - n * 0.693359375f) - n * -2.12194440e-4f;
    float p = 1.9875691500e-4f;
    MATH_EXP_SERIES(p, r);
    union { int32_t i; float f; } s = { ((int32_t)n + 127) << 23 };
    return p * s.f;
}

static inline float math_sigmoid(float x)
{
    return 1 / (1 + math_exp(-x));
}

static inline float math_tanh(float x)
{
    return 1 - 2 / (1 + math_exp(2 * x));
}

/* act(x); act is a constant where this is inlined. */
static inline __attribute__((always_inline)) float math_act(float x, int act)
{
    switch (act) {
    case ACT_RELU:
        return x > 0 ? x : 0;
    case ACT_LRELU:
        return x > 0 ? x : ACT_SLOPE * x;
    case ACT_HARDSWISH:
    case ACT_HARDSIGMOID: {
        float t = x + 3;
        t = t < 0 ? 0 : t;
        t = t > 6 ? 6 : t;
        return act == ACT_HARDSWISH ? x * t * (1.0f / 6) : t * (1.0f / 6);
    }
    case ACT_SIGMOID:
        return math_sigmoid(x);
    case ACT_TANH:
        return math_tanh(x);
    case ACT_GELU:
        return 0.5f * x * (1 + erff(x * 0.70710678f));
    case ACT_GELU_TANH:
        return x * math_sigmoid(x * ((float)ACT_GELU_A +
                                     (float)ACT_GELU_B * x * x));
    case ACT_SILU:
        return x * math_sigmoid(x);
    default:
        return x;
    }
}

/* act'(x) */
static inline __attribute__((always_inline)) float math_slope(float x, int act)
{
    switch (act) {
    case ACT_RELU:
        return x > 0 ? 1 : 0;
    case ACT_LRELU:
        return x > 0 ? 1 : ACT_SLOPE;
    case ACT_HARDSWISH: {
        float in = x > -3 ? (2 * x + 3) * (1.0f / 6) : 0;
        return x < 3 ? in : 1;
    }
    case ACT_HARDSIGMOID: {
        float in = x > -3 ? 1.0f / 6 : 0;
        return x < 3 ? in : 0;
    }
    case ACT_SIGMOID: {
        float y = math_sigmoid(x);
        return y * (1 - y);
    }
    case ACT_TANH: {
        float y = math_tanh(x);
        return 1 - y * y;
    }
    case ACT_GELU:
        return 0.5f * (1 + erff(x * 0.70710678f)) +
               x * 0.39894228f * math_exp(-0.5f * x * x);
    case ACT_GELU_TANH: {
        const float a = (float)ACT_GELU_A, b = (float)ACT_GELU_B;
        float y = math_sigmoid(x * (a + b * x * x));
        return y + x * y * (1 - y) * (a + 3 * b * x * x);
    }
    case ACT_SILU: {
        float y = math_sigmoid(x);
        return y + x * y * (1 - y);
    }
    default:
        return 1;
    }
}

/* act' from the output y */
static inline __attribute__((always_inline)) float math_slope_out(float y,
                                                                  int act)
{
    switch (act) {
    case ACT_RELU:
        return y > 0 ? 1 : 0;
    case ACT_LRELU:
        return y > 0 ? 1 : ACT_SLOPE;
    case ACT_SIGMOID:
        return y * (1 - y);
    case ACT_TANH:
        return 1 - y * y;
    default:
        return 1;
    }
}

/* switch (act) outside a loop, the activation a constant inside it */
#define MATH_FOR_ACT(act, LOOP)                                              \
    switch (act) {                                                           \
    case ACT_NONE: LOOP(ACT_NONE) break;                                     \
    case ACT_RELU: LOOP(ACT_RELU) break;                                     \
    case ACT_LRELU: LOOP(ACT_LRELU) break;                                   \
    case ACT_HARDSWISH: LOOP(ACT_HARDSWISH) break;                           \
    case ACT_HARDSIGMOID: LOOP(ACT_HARDSIGMOID) break;                       \
    case ACT_SIGMOID: LOOP(ACT_SIGMOID) break;                               \
    case ACT_TANH: LOOP(ACT_TANH) break;                                     \
    case ACT_GELU: LOOP(ACT_GELU) break;                                     \
    case ACT_GELU_TANH: LOOP(ACT_GELU_TANH) break;                           \
    case ACT_SILU: LOOP(ACT_SILU) break;                                     \
    }

#endif
