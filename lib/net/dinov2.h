/* DINOv2's vision transformer, any width, depth and patch; with registers for
 * inference alone.
 * Tensors have the public names ("blocks.0.attn.qkv.weight", ...). */
#ifndef SPID_NET_DINOV2_H
#define SPID_NET_DINOV2_H

#include <stdbool.h>

#include "lib/nn/nn.h"
#include "lib/nn/params.h"

struct dinov2_config {
    size_t embed, depth, heads, patch;
    size_t grid;       /* of the checkpoint's position embedding, 37 */
    size_t last;       /* how many blocks are given out, 4 */
    size_t registers;  /* learned tokens behind the class token; with them the
                        * public models resize positions by another rule, 0 */
    bool spread;       /* the last of each of so many parts of the depth are
                        * given out, not the last of all */
};

#define DINOV2_GRID 37      /* of the public models' position embedding */

struct dinov2_impl;

struct dinov2 {
    struct dinov2_config config;
    size_t batch, grid_h, grid_w;
    size_t tokens;     /* of an item: class token, registers, grid_h * grid_w
                        * patches */
    struct dinov2_impl *impl;
};

/* frozen: nothing of it is trained (params' frozen flag). */
int dinov2_init(struct dinov2 *d, struct params *ps, const char *prefix,
                const struct dinov2_config *config, bool frozen,
                struct error *err);
/* height and width are multiples of the patch. */
int dinov2_plan(struct dinov2 *d, size_t batch, size_t height, size_t width,
                struct nn_options opt, struct error *err);
/* Free what _init and _plan allocated; zeroed then. */
void dinov2_release(struct dinov2 *d);

/* One pass on rgb (B,H,W,3), already normalised; results by dinov2_tokens. */
void dinov2_forward(const float *rgb, struct dinov2 *d);
/* The k-th given-out block after the final norm, (B,tokens,embed). */
const float *dinov2_tokens(const struct dinov2 *d, size_t k);
/* Before any block (k = 0) or after block k-1, (B,tokens,embed), not
 * normalised; plans with a backward only. */
const float *dinov2_raw(const struct dinov2 *d, size_t k);
/* The position embedding as resized, (tokens,embed). */
const float *dinov2_position(const struct dinov2 *d);
/* drgb (or NULL) and the weights' gradients from dtokens[k], as dinov2_tokens
 * (NULL: zero).  NN_FROZEN or NN_TRAIN plans only. */
void dinov2_backward(float *drgb, const float *const *dtokens,
                     struct dinov2 *d);

#endif
