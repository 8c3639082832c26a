/* From the source picture to the feature image every branch samples: the
 * small convolutional backbone that ships, or DINOv2 with its fusion head
 * (lib/net/dino_base.h), behind one interface. */
#ifndef SPID_NET_BACKBONE_H
#define SPID_NET_BACKBONE_H

#include "lib/nn/graph.h"
#include "lib/nn/nn.h"
#include "lib/nn/params.h"

enum backbone_type { BACKBONE_SMALL, BACKBONE_DINOV2 };

struct backbone_config {
    enum backbone_type type;
    size_t features;      /* C_f: channels of the feature image */
    size_t size;          /* n: it is n x n */
    size_t width;         /* BACKBONE_SMALL: 16 ships */
    /* BACKBONE_DINOV2: */
    size_t embed, depth, heads, patch;
    size_t image;         /* the picture is resized to this, 518 */
    size_t registers;     /* SYSTEM_LAM's encoder alone has any */
};

struct backbone_impl;
struct dino_base;

struct backbone {
    struct backbone_config config;
    size_t batch, input;
    struct backbone_impl *impl;
};

/* Fails (EX_CONFIG) on sizes that do not go together. */
int backbone_init(struct backbone *b, struct params *ps, const char *prefix,
                  const struct backbone_config *config, struct error *err);
/* input is the source picture's side in pixels (512). */
int backbone_plan(struct backbone *b, size_t batch, size_t input,
                  struct nn_options opt, struct error *err);
/* Free what _init and _plan allocated; zeroed then. */
void backbone_release(struct backbone *b);

/* features (B,n,n,C_f) from rgb (B,S,S,3) in [0,1].  Pixel (i,j) of the
 * features covers the same part of the picture as cell (i,j) of a plain
 * n x n grid over it. */
void backbone_forward(float *features, const float *rgb, struct backbone *b);
/* token (B,embed): what the whole picture looked like in the last forward, as
 * GAGAvatar takes it: the first patch's token after the last block (its code
 * means the class token).  BACKBONE_DINOV2 only. */
void backbone_token(float *token, const struct backbone *b);
/* The network behind it; NULL unless BACKBONE_DINOV2.  For tests. */
const struct dino_base *backbone_dino(const struct backbone *b);
/* No gradient for the picture; the ViT is frozen, its fusion head is not. */
void backbone_backward(const float *dfeatures, struct backbone *b);

/* The same as a graph: "picture" (1,input,input,3) in [0,1] to "features"
 * (1,n,n,C_f).  BACKBONE_SMALL only; the graph remembers that otherwise. */
void backbone_graph(struct graph *g, size_t input, const struct backbone *b);

#endif
