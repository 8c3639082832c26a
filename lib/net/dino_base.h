/* The full backbone: DINOv2's patch tokens of the last four blocks, brought to
 * four scales, each joined with the picture and fused from coarse to fine (a
 * DPT head).  Tensors have GAGAvatar's names ("projects.0.weight", ...; the
 * transformer's under "dino_model.").  Behind lib/net/backbone.h. */
#ifndef SPID_NET_DINO_BASE_H
#define SPID_NET_DINO_BASE_H

#include "lib/net/dinov2.h"
#include "lib/nn/conv.h"
#include "lib/nn/rescale.h"

#define DINO_LEVELS 4

/* x + conv2(relu(conv1(relu(x)))) */
struct residual_unit {
    struct conv conv1, conv2;
    float *r, *h;                 /* relu(x), relu(conv1 r) */
};

struct dino_level {
    struct conv project, shrink, join;  /* 1x1; level 3's 3x3 s2; layer_rn */
    struct conv grow;             /* levels 0, 1: transposed */
    size_t factor;                /* 4, 2, 1, and 1 for the last */
    size_t channels, h, w;
    struct rescale picture;
    float *tokens, *p, *f;        /* patches; projected; at its scale */
    float *image, *cat, *rn;      /* (h,w,3), (h,w,3 + channels), (h,w,C) */
    float *shuffled;              /* grow's output before the pixel shuffle */
};

struct dino_fusion {
    struct residual_unit skip, main;
    struct conv out;
    struct rescale grow;
    size_t h, w, oh, ow;          /* before and after growing */
    float *y, *m, *c, *o;         /* sum; main(y); out(m); grown */
};

struct dino_base {
    struct nn_plan plan;
    struct params *ps;
    struct dinov2 vit;
    size_t out;                   /* channels of the features, 256 */
    size_t size;                  /* features are size x size */
    size_t batch, h, w;           /* of the picture the transformer sees */
    struct dino_level level[DINO_LEVELS];
    struct dino_fusion fusion[DINO_LEVELS];
    struct conv last;
    struct rescale resized, final;
    bool resize_in, resize_out;
    float *picture, *feature;
    float *g[5];                  /* gradients on their way */
};

/* The transformer is frozen. */
int dino_base_init(struct dino_base *d, struct params *ps, const char *prefix,
                   const struct dinov2_config *vit, size_t out,
                   struct error *err);
/* Pictures of input x input_w pixels are resized to h x w (multiples of the
 * patch) unless they have that size; features are size x size. */
int dino_base_plan(struct dino_base *d, size_t batch, size_t input_h,
                   size_t input_w, size_t h, size_t w, size_t size,
                   struct nn_options opt, struct error *err);
/* Free what _init and _plan allocated; zeroed then. */
void dino_base_release(struct dino_base *d);
/* features (B,size,size,out) of rgb (B,input_h,input_w,3) in [0,1]. */
void dino_base_forward(float *features, const float *rgb, struct dino_base *d);
/* Gradients of the head's weights. */
void dino_base_backward(const float *dfeatures, struct dino_base *d);

/* For golden 03, plans with a backward: cat{k}, layer_rn{k}, refine{i} and
 * `feature` before its last resizing; (B,h,w,c) in shape. */
enum dino_stage { DINO_CAT, DINO_RN, DINO_REFINE, DINO_FEATURE };
/* The k-th of that stage, and its shape. */
const float *dino_base_stage(size_t shape[4], const struct dino_base *d,
                             enum dino_stage stage, size_t k);

#endif
