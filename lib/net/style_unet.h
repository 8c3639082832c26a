/* StyleUNet as GAGAvatar lays it out: an encoder-decoder of residual blocks
 * whose maps condition (scale and shift) a StyleGAN2 decoder, whose style is
 * coded from the innermost map.  Tensors have GAGAvatar's names.  Behind
 * lib/net/refiner.h. */
#ifndef SPID_NET_STYLE_UNET_H
#define SPID_NET_STYLE_UNET_H

#include "lib/nn/tape.h"

#define STYLE_LEVELS 9       /* up to 2048 pixels */

/* Maps of the tape: the way down, and from 8x8 on the way up and the
 * decoder's. */
struct style_level {
    int down, up, enlarge, same, rgb;
};

struct style_unet {
    struct tape tape;
    size_t channels, in_size, out_size, levels;
    float multiplier;
    int code, latent, conv1;     /* maps, too */
    struct style_level level[STYLE_LEVELS];
};

/* in_size and out_size: powers of two, in_size at most 2 out_size; multiplier
 * scales every width. */
int style_unet_init(struct style_unet *s, struct params *ps,
                    const char *prefix, size_t channels, size_t in_size,
                    size_t out_size, float multiplier, struct error *err);
/* For `batch` feature images of in_size. */
int style_unet_plan(struct style_unet *s, size_t batch, struct nn_options opt,
                    struct error *err);
/* Free what _init and _plan allocated; zeroed then. */
void style_unet_release(struct style_unet *s);
/* image (B,out,out,3) = sigmoid of the last rgb, from feat (B,in,in,C). */
void style_unet_forward(float *image, const float *feat,
                        struct style_unet *s);
/* dfeat is written, or NULL. */
void style_unet_backward(float *dfeat, const float *dimage,
                         struct style_unet *s);

#endif
