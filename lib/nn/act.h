/* Activations, and what goes with them: bias gradients. */
#ifndef SPID_NN_ACT_H
#define SPID_NN_ACT_H

#include <stddef.h>
#include <stdint.h>

enum nn_act {
    ACT_NONE,
    ACT_RELU,
    ACT_LRELU,        /* slope 0.2 */
    ACT_HARDSWISH,    /* x clamp(x+3,0,6)/6 */
    ACT_HARDSIGMOID,  /* clamp(x+3,0,6)/6 */
    ACT_SIGMOID,
    ACT_TANH,
    ACT_GELU,         /* the exact, erf form */
    ACT_GELU_TANH,    /* its approximation by tanh */
    ACT_SILU          /* x sigmoid(x) */
};

#define ACT_SLOPE 0.2f
/* What keeps the variance of weights' outputs behind it: sqrt(2 / (1 + 0.2^2)). */
#define ACT_LRELU_GAIN 1.3867505f
/* gelu by tanh is x sigmoid(a x + b x^3): a = 2 sqrt(2 / pi), b = 0.044715 a */
#define ACT_GELU_A (M_2_SQRTPI * M_SQRT2)
#define ACT_GELU_B (0.044715 * ACT_GELU_A)

/* y = act(x), n values; y may be x. */
void act_forward(float *y, const float *x, enum nn_act act, size_t n);
/* dx = dy act'(x); dx may be dy. */
void act_backward(float *dx, const float *dy, const float *x, enum nn_act act,
                  size_t n);
/* The same from the output y instead of x: ACT_NONE, ACT_RELU, ACT_LRELU,
 * ACT_SIGMOID and ACT_TANH only. */
void act_backward_out(float *dx, const float *dy, const float *y,
                      enum nn_act act, size_t n);

/* db (C) += column sums of dz (rows,C), where dz = dout act'(.) is written
 * over dout first (act as act_backward_out; out is not read for ACT_NONE).
 * db may be NULL; part is scratch of NN_SUMS * C floats.  Fixed split: the
 * same bits for any number of threads. */
void act_bias_backward(float *db, float *dout, float *part, const float *out,
                       enum nn_act act, size_t rows, size_t C);
/* The same where dout and out are bfloat16; ACT_NONE or ACT_RELU. */
void act_bias_backward_half(float *db, uint16_t *dout, float *part,
                            const uint16_t *out, enum nn_act act, size_t rows,
                            size_t C);

#endif
