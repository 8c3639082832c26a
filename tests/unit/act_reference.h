/* Activations and their derivatives in double precision: what the kernels are
 * compared with. */
#ifndef SPID_TESTS_ACT_REFERENCE_H
#define SPID_TESTS_ACT_REFERENCE_H

#include <math.h>

#include "lib/nn/act.h"

static double act_value(enum nn_act act, double x)
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
    default:
        return x;
    }
}

static double act_slope(enum nn_act act, double x)
{
    double y = act_value(act, x);

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
    default:
        return 1;
    }
}

#endif
