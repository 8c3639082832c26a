/* The narrow refiner's last layers, for inference: what is added to the
 * picture and the field of the photograph come from one convolution, and it
 * and the layer before are computed only where a covered pixel sees them. */
#ifndef SPID_NET_NARROW_END_H
#define SPID_NET_NARROW_END_H

#include <stdbool.h>
#include <stdint.h>

#include "lib/nn/conv.h"
#include "lib/nn/winograd.h"

#define NARROW_END_CELL 4       /* pixels across a place of the maps */
#define NARROW_END_COLORS 48    /* numbers of its pixels' colours */

struct narrow_end {
    const struct conv *rgb, *field;     /* declare the weights; field NULL:
                                         * none */
    struct winograd joint;      /* both; planned: .u is not NULL */
    float *weight, *bias;       /* of both, and zeros up to 16 channels */
    float *map;                 /* (B,h,w,joint.out) */
    uint8_t *cell;              /* (h,w) whether a pixel of it is covered */
    uint8_t *tile;              /* (tiles) whether it is wanted */
    uint32_t *list[2];          /* tiles wanted of joint, of the layer before */
    bool some;                  /* the lists and cells are to be used */
    float max;                 /* of a tint */
};

/* colors (n,48): tint (n,3), within max, for each pixel of a place. */
void narrow_end_spread(float *colors, const float *tint, float max, size_t n);
/* dtint (n,3), written, from the gradient of the colours. */
void narrow_end_spread_backward(float *dtint, const float *dcolors,
                                const float *tint, float max, size_t n);

/* After both layers were planned; nothing is planned where Winograd does not
 * serve them.  max: of a tint. */
void narrow_end_plan(struct narrow_end *e, struct conv *rgb,
                     struct conv *field, float max, struct nn_plan *p);

/* What the next passes have to compute, of joint and of `before`, whose map
 * joint reads: what pixels see whose alpha is not 0, rows `stride` apart; all
 * of it where alpha is NULL or the batch not 1. */
void narrow_end_set_coverage(struct narrow_end *e, struct conv *before,
                             const float *alpha, size_t stride);

/* rgb (B,4h,4w,3) += what the map before (B,h,w,in) makes, 3 numbers for all of
 * a place or 48; field (B,h,w,4) written, unless there is none.  Where
 * narrow_end_set_coverage says that nobody looks, both stay. */
void narrow_end_forward(float *rgb, float *field, const float *before,
                        struct narrow_end *e);

/* The same with what the last narrow_end_forward made, for another alpha; false,
 * and nothing done, where that shows a place which was not computed, or either
 * has none. */
bool narrow_end_repeat(float *rgb, float *field, struct narrow_end *e,
                       const float *alpha, size_t stride);

#endif
