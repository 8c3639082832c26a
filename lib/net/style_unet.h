/* StyleUNet as GAGAvatar lays it out: an encoder-decoder of residual blocks
 * whose maps condition (scale and shift) a StyleGAN2 decoder, whose style is
 * coded from the innermost map.  Tensors have GAGAvatar's names.  Behind
 * lib/net/refiner.h. */
#ifndef SPID_NET_STYLE_UNET_H
#define SPID_NET_STYLE_UNET_H

#include "lib/net/style_blocks.h"
#include "lib/nn/style.h"

#define STYLE_LEVELS 9       /* up to 2048 pixels */

struct style_level {
    struct style_res down, up;
    struct style_condition scale, shift;
    struct style_conv enlarge, same;
    struct to_rgb rgb;
    size_t side;                 /* of the decoder's maps */
    float *f;                    /* up's input: f + down */
    float *sft;                  /* enlarge's output, transformed */
    float *ddown;
};

struct style_unet {
    struct nn_plan plan;
    struct params *ps;
    size_t channels, in_size, out_size, levels, latent;
    float multiplier;
    bool halve;                  /* in_size > out_size */
    size_t batch, side;          /* of the picture given */
    struct conv first, final_conv, final_linear, mlp[8];
    struct style_res first_res;
    size_t constant;             /* tensor (1,C,4,4) */
    struct style_conv conv1;
    struct to_rgb rgb1;
    struct style_level level[STYLE_LEVELS];
    struct rescale enlarge;
    const float *feat;
    float *in, *x0, *inner, *flat, *code, *normal, *style[8];
    float *constants, *image;
    /* gradients */
    float *g[5], *dlatent, *dstyle, *dflat, *drgb[2];
};

/* in_size and out_size: powers of two, in_size at most 2 out_size; multiplier
 * scales every width. */
int style_unet_init(struct style_unet *s, struct params *ps,
                    const char *prefix, size_t channels, size_t in_size,
                    size_t out_size, float multiplier, struct error *err);
/* Channels of the encoder at a side; the decoder has twice as many. */
size_t style_unet_width(const struct style_unet *s, size_t side);
/* For `batch` feature images of in_size. */
int style_unet_plan(struct style_unet *s, size_t batch, struct nn_options opt,
                    struct error *err);
/* Free what _init and _plan allocated; zeroed then. */
void style_unet_release(struct style_unet *s);
/* image (B,out,out,3) = sigmoid of s's last rgb, from feat (B,in,in,C). */
void style_unet_forward(float *image, const float *feat,
                        struct style_unet *s);
/* dfeat is written, or NULL. */
void style_unet_backward(float *dfeat, const float *dimage,
                         struct style_unet *s);

#endif
