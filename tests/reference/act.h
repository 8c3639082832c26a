/* One value of an activation, in double: what kernels are held against. */
#ifndef SPID_TESTS_ACT_H
#define SPID_TESTS_ACT_H

#include "lib/nn/act.h"

double act_value(enum nn_act act, double x);
/* Its derivative. */
double act_slope(enum nn_act act, double x);

#endif
