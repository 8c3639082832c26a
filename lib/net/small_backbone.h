/* The small convolutional backbone: an encoder-decoder with skips, five
 * levels n, n/2 .. n/16 of 2w, 3w, 6w, 8w, 8w channels, ReLU, no norms.
 * 3.7 GMAC at n = 296, w = 16.  Behind lib/net/backbone.h. */
#ifndef SPID_NET_SMALL_BACKBONE_H
#define SPID_NET_SMALL_BACKBONE_H

#include "lib/nn/tape.h"

struct small_backbone {
    struct tape tape;             /* of pictures (B,input,input,3) in [0,1]; last
                                   * the features (B,size,size,C_f) */
    size_t size;
};

/* Declare the tensors: C_f features of size x size, channels by width. */
void small_backbone_init(struct small_backbone *s, struct params *ps,
                         const char *prefix, size_t features, size_t size,
                         size_t width);
/* For pictures of input x input pixels; its passes are the tape's. */
int small_backbone_plan(struct small_backbone *s, size_t batch, size_t input,
                        struct nn_options opt, struct error *err);
/* Free what _init and _plan allocated; zeroed then. */
void small_backbone_release(struct small_backbone *s);

/* The same as a graph: maps of the features from a picture (1,input,input,3),
 * which must not be larger than twice the features. */
int small_backbone_graph(struct graph *g, int picture, size_t input,
                         const struct small_backbone *s);

#endif
