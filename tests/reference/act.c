/* Activations in double precision, and their slopes. */
#include "tests/reference/act.h"

#include <math.h>

double act_value(enum nn_act act, double x)
{
    double t = fmin(fmax(x + 3, 0), 6) / 6;

    switch (act) {
    case ACT_RELU:
        return x > 0 ? x : 0;
    case ACT_LRELU:
        return x > 0 ? x : (double)ACT_SLOPE * x;
    case ACT_HARDSWISH:
        return x * t;
    case ACT_HARDSIGMOID:
        return t;
    case ACT_SIGMOID:
        return 1 / (1 + exp(-x));
    case ACT_TANH:
        return tanh(x);
    case ACT_GELU:
        return 0.5 * x * (1 + erf(x * sqrt(0.5)));
    case ACT_GELU_TANH:
        return x / (1 + exp(-x * (ACT_GELU_A + ACT_GELU_B * x * x)));
    case ACT_SILU:
        return x / (1 + exp(-x));
    default:
        return x;
    }
}

double act_slope(enum nn_act act, double x)
{
    double y = act_value(act, x), t;

    switch (act) {
    case ACT_RELU:
        return x > 0;
    case ACT_LRELU:
        return x > 0 ? 1 : (double)ACT_SLOPE;
    case ACT_HARDSWISH:
        return x <= -3 ? 0 : x < 3 ? (2 * x + 3) / 6 : 1;
    case ACT_HARDSIGMOID:
        return x > -3 && x < 3 ? 1.0 / 6 : 0;
    case ACT_SIGMOID:
        return y * (1 - y);
    case ACT_TANH:
        return 1 - y * y;
    case ACT_GELU:
        return 0.5 * (1 + erf(x * sqrt(0.5))) +
               x * exp(-0.5 * x * x) * 0.39894228040143268;
    case ACT_GELU_TANH:
        t = 1 / (1 + exp(-x * (ACT_GELU_A + ACT_GELU_B * x * x)));
        return t + y * (1 - t) * (ACT_GELU_A + 3 * ACT_GELU_B * x * x);
    case ACT_SILU:
        t = 1 / (1 + exp(-x));
        return t + y * (1 - t);
    default:
        return 1;
    }
}
