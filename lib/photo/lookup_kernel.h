/* Inside lib/photo: the lookup's inner loops, once per instruction set. */
#ifndef SPID_PHOTO_LOOKUP_KERNEL_H
#define SPID_PHOTO_LOOKUP_KERNEL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/isa.h"
#include "lib/splat/types.h"
#include "lib/photo/lookup.h"

#define LOOKUP_RUN 128          /* pixels that are looked up at a time */

/* A run of a row, and what is found for its pixels. */
struct lookup_run {
    float nx, ny, step;         /* normalised position of the first pixel's
                                 * centre, and to the next one's */
    float half;                 /* half the texture's side */
    _Alignas(64) float confidence[LOOKUP_RUN];    /* confidence, 0 without a place, */
    _Alignas(64) float solid[LOOKUP_RUN];   /* by how much it is less where the
                                             * photograph shows nobody, */
    _Alignas(64) float grain[LOOKUP_RUN];   /* and how much of the grain, 0..1, */
    bool grained;               /* and whether any has some */
    float u[LOOKUP_RUN], v[LOOKUP_RUN];     /* places, the texture's pixels */
};

/* What is found for n pixels, a multiple of 16, from what was blended there: place
 * (n,4) and alpha (n); whether any has a place. */
typedef bool lookup_places_fn(struct lookup_run *r,
                              const struct splat_place_view *v,
                              const struct splat_place_side *side,
                              const float *place, const float *alpha,
                              size_t n);

/* photo (n,5) = texture (S,S,4) at r's places by Keys's bicubic, 0..1, and the
 * confidence that is left; a confidence of 0 or less leaves its pixel alone.
 * Border pixels go on outside. */
typedef void texture_bicubic_fn(float *photo, const struct lookup_run *r,
                                size_t n, const uint8_t *texture, size_t S);

/* texture_mix of n pixels of three channels. */
typedef void texture_mix_fn(float *color, float *alpha, const float *photo,
                            size_t n);

struct lookup_kernels {
    lookup_places_fn *places;
    texture_bicubic_fn *bicubic;
    texture_mix_fn *mix;
};

ISA_VERSIONS(const struct lookup_kernels, lookup_kernels);

#endif
