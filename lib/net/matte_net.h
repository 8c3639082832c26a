/* The matte network: how much of every pixel of a portrait is the person in
 * the middle.  The small backbone (lib/net/small_backbone.h) on half the
 * picture's side, whose features are the logits of 2x2 pixels each.
 * 498,000 weights at width 12; 0.33 GMAC for 256x256 pixels. */
#ifndef SPID_NET_MATTE_NET_H
#define SPID_NET_MATTE_NET_H

#include "lib/net/small_backbone.h"
#include "lib/nn/graph.h"

#define MATTE_SIDE 256          /* of the pictures it learns from and sees */
#define MATTE_WIDTH 12          /* of the network that ships */

struct matte_net {
    struct small_backbone net;
    size_t side;
};

/* Declare the tensors, "<prefix>down.0.weight" and on: pictures of side x
 * side pixels, a multiple of 32. */
void matte_net_init(struct matte_net *m, struct params *ps,
                    const char *prefix, size_t side, size_t width);
/* For `batch` pictures at a time. */
int matte_net_plan(struct matte_net *m, size_t batch, struct nn_options opt,
                   struct error *err);
/* Free what _init and _plan allocated; zeroed then. */
void matte_net_release(struct matte_net *m);

/* logit (B,side,side) from rgb (B,side,side,3) in [0,1]; see
 * matte_net_alpha. */
void matte_net_forward(float *logit, const float *rgb, struct matte_net *m);
/* The weights' gradients from dlogit (B,side,side). */
void matte_net_backward(const float *dlogit, struct matte_net *m);

/* The matte, 0 to 1, that a logit stands for. */
double matte_net_alpha(float logit);

/* Mean cross entropy of the matte against alpha (n) in [0,1], pixel i counted
 * weight[i] times, times scale; dlogit (n) is its gradient. */
double matte_net_loss(float *dlogit, const float *logit, const float *alpha,
                      const float *weight, double scale, size_t n);

/* The same as a graph: "picture" (1,side,side,3) in [0,1] to "alpha"
 * (1,side,side,1), 0 to 1. */
void matte_net_graph(struct graph *g, const struct matte_net *m);

#endif
