/* The full backbone: DINOv2's patch tokens of the last four blocks, brought to
 * four scales, each joined with the picture and fused from coarse to fine (a
 * DPT head).  Tensors have GAGAvatar's names ("projects.0.weight", ...; the
 * transformer's under "dino_model.").  Behind lib/net/backbone.h. */
#ifndef SPID_NET_DINO_BASE_H
#define SPID_NET_DINO_BASE_H

#include "lib/net/dinov2.h"
#include "lib/nn/tape.h"

#define DINO_LEVELS 4

struct dino_base {
    struct dinov2 vit;
    size_t h, w;                  /* of the picture the transformer sees */
    struct tape tape;             /* of pictures (B,input_h,input_w,3) in [0,1];
                                   * last the features (B,size,size,out) */
    /* Maps that golden 03 has: a level joined with the picture, its channels
     * padded; layer_rn's; a fusion's; the features before their resizing. */
    int cat[DINO_LEVELS], rn[DINO_LEVELS], refine[DINO_LEVELS], feature;
};

/* Pictures are resized to h x w pixels (multiples of the patch), features are
 * size x size of `out` channels.  The transformer is frozen. */
int dino_base_init(struct dino_base *d, struct params *ps, const char *prefix,
                   const struct dinov2_config *vit, size_t h, size_t w,
                   size_t size, size_t out, struct error *err);
/* For pictures of input_h x input_w pixels; its passes are the tape's. */
int dino_base_plan(struct dino_base *d, size_t batch, size_t input_h,
                   size_t input_w, struct nn_options opt, struct error *err);
/* Free what _init and _plan allocated; zeroed then. */
void dino_base_release(struct dino_base *d);

#endif
