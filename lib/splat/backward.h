/* Inside the rasteriser: what the backward pass keeps.  Not for other
 * modules. */
#ifndef SPID_SPLAT_BACKWARD_H
#define SPID_SPLAT_BACKWARD_H

#include "lib/splat/state.h"

#define MOMENTS 6              /* sums of dL/dq times 1, x, y, xx, xy, yy */
#define GRADIENT_BATCH 1024    /* Gaussians whose camera gradients are summed
                                * in float, in a fixed order */

/* Sums over one tile's pixels of one Gaussian: MOMENTS floats about the tile's
 * centre, then dL/dcolor; `stride` floats apart.  seen[p] is 0 where nothing
 * was written. */
struct splat_gradient_state {
    float *pair;
    uint8_t *seen;
    size_t room;               /* pairs that fit */
    int stride;
    uint32_t *base;            /* (N+1) first pair of each Gaussian */
    float *inverse_length;     /* (N) 1 / |quat as given| */
    double *rt;                /* (batches, 12) */
    size_t n;                  /* Gaussians that fit */
    float *T;                  /* (H,W) final transmittance */
    float *image;              /* (H,W,C) the last forward's, without
                                * background */
    float background[SPLAT_MAX_CHANNELS];
    bool drawn;
};

int backward_init(struct splat *s);                /* -1: no memory */
void backward_release(struct splat *s);
int backward_load(struct splat *s, const struct gaussians *g,
                  struct error *err);
/* Have the frame about to be drawn keep T. */
void backward_keep(struct splat *s, struct target *out);

#endif
