/* Inside the rasteriser: what the backward pass keeps.  Not for other
 * modules. */
#ifndef SPID_SPLAT_BACKWARD_H
#define SPID_SPLAT_BACKWARD_H

#include "lib/splat/state.h"

#define GRADIENT_BATCH 1024    /* Gaussians whose camera gradients are summed
                                * in float, in a fixed order */

/* Sums over a tile's pixels of dL/dq x^k y^f are float 4 k + f of a pair (of
 * these, k + f <= 2 are meant); of dL/dcolor, up to three channels, or with
 * places of the four of dL/dplace, float 4 c + 3. */
#define MOMENT(k, f) (4 * (k) + (f))
#define GRAD_COLOR(c) (4 * (c) + 3)

/* Where a Gaussian's pairs are: that of tile (tx, ty) is origin + ty across +
 * tx, by the rules of uint32_t. */
struct pair_range {
    uint32_t origin, across;
};

/* A pair has 16 floats, about the Gaussian's centre, and with more than three
 * channels or places dL/dcolor behind them; `stride` floats in all.  seen[p] is
 * 0 where nothing was written, else 1 + its Gaussian's number modulo the lanes
 * of a vector. */
struct splat_gradient_state {
    float *pair;
    size_t pair_bytes;
    uint8_t *seen;
    size_t room;               /* pairs that fit */
    int stride;
    float *each;               /* what the next four lie in */
    struct pair_range *range;  /* (N) */
    float *inverse_length;     /* (N) 1 / |quat as given| */
    float *inverse_opacity;    /* (N), 0 for opacity 0 */
    double *rt;                /* (batches, 12) */
    size_t n;                  /* Gaussians that fit */
    float *T;                  /* (H,W) final transmittance */
    float *image;              /* (H,W,C) the last forward's, without
                                * background */
    float background[SPLAT_MAX_CHANNELS];
    float *place;              /* (H,W,4) its places, with opt.place */
    bool drawn, placed;        /* there was a frame; places were drawn, ... */
    bool pulled;               /* ... and have gradients */
};

/* What the picture's size decides; -1: no memory. */
int backward_init(struct splat *s);
/* NULL is allowed. */
void backward_release(struct splat *s);
/* What goes with a new set of Gaussians.  EX_OSERR. */
int backward_load(struct splat *s, const struct gaussians *g,
                  struct error *err);
/* Have the frame about to be drawn keep T and its image without background. */
void backward_keep(struct splat *s, struct target *out);

#endif
