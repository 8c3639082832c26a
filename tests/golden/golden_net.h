/* What the cases of networks share: the network's weights from the formula, its
 * input as rows of pixels, and the gradients that a case lists by name. */
#ifndef SPID_TESTS_GOLDEN_NET_H
#define SPID_TESTS_GOLDEN_NET_H

#include "lib/base/error.h"
#include "tests/golden/layout.h"

struct golden_net {
    struct golden *g;
    struct params ps;             /* for the network's _init */
    struct golden_weights w;
    size_t in[4];                 /* (B,h,w,C) of the input */
    float *rgb;                   /* the input, (B,h,w,C) */
};

/* Sizes from the case's "input_shape"; no tensors yet. */
void golden_net_begin(struct golden_net *n, struct golden *g);
/* After the network's _init, which gave rc: memory, weights and the input
 * "input.image" (signed_range: -1 to 1).  False, counted and printed, when
 * anything failed. */
bool golden_net_ready(struct golden_net *n, int rc, bool signed_range,
                      struct error *err);
/* Before the network's _release. */
void golden_net_end(struct golden_net *n);

/* rc is not 0: print the error and count it. */
bool golden_failed(struct golden *g, int rc, const struct error *err);
/* The gradient of one tensor against "grad.<tensor>": each value, or the L2
 * norm of the difference. */
void golden_net_gradient(struct golden *g, const struct params *ps,
                         const char *tensor, bool l2);

#endif
