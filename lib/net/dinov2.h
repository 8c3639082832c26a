/* DINOv2's vision transformer without registers, any width, depth and patch.
 * Tensors have the public names ("blocks.0.attn.qkv.weight", ...). */
#ifndef SPID_NET_DINOV2_H
#define SPID_NET_DINOV2_H

#include "lib/nn/nn.h"
#include "lib/nn/params.h"

struct dinov2_config {
    size_t embed, depth, heads, patch;
    size_t grid;       /* of the checkpoint's position embedding, 37 */
    size_t last;       /* how many last blocks are given out, 4 */
};

struct dinov2_impl;

struct dinov2 {
    struct dinov2_config config;
    size_t batch, grid_h, grid_w;
    struct dinov2_impl *impl;
};

int dinov2_init(struct dinov2 *d, struct params *ps, const char *prefix,
                const struct dinov2_config *config, struct error *err);
/* height and width are multiples of the patch. */
int dinov2_plan(struct dinov2 *d, size_t batch, size_t height, size_t width,
                struct nn_options opt, struct error *err);
void dinov2_update(struct dinov2 *d);
void dinov2_release(struct dinov2 *d);

/* One pass on rgb (B,H,W,3), already normalised; results by dinov2_patches. */
void dinov2_forward(const float *rgb, struct dinov2 *d);
/* Patch tokens of the k-th given-out block after the final norm,
 * (B, 1 + gh*gw, embed) with the class token first. */
const float *dinov2_tokens(const struct dinov2 *d, size_t k);
/* drgb and the weights' gradients from dtokens[k] (as dinov2_tokens; NULL:
 * zero).  NN_FROZEN or NN_TRAIN plans only. */
void dinov2_backward(float *drgb, const float *const *dtokens,
                     struct dinov2 *d);

#endif
