/* Inside lib/photo: the lookup's inner loops, once per instruction set.  A
 * picture is looked up tile by tile; a tile's places lie in three planes, with
 * what surrounds it. */
#ifndef SPID_PHOTO_LOOKUP_KERNEL_H
#define SPID_PHOTO_LOOKUP_KERNEL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/isa.h"
#include "lib/splat/types.h"
#include "lib/photo/lookup.h"

#define LOOKUP_WIDE 128         /* pixels of a tile's row, */
#define LOOKUP_HIGH 32          /* ... its rows, */
#define LOOKUP_SIDE 16          /* ... columns left and right of it, */
#define LOOKUP_ABOVE 3          /* ... and rows above and below */
#define LOOKUP_LINE (LOOKUP_WIDE + 2 * LOOKUP_SIDE)
#define LOOKUP_LINES (LOOKUP_HIGH + 2 * LOOKUP_ABOVE)

/* Offsets and their weight; no place: weight 0. */
struct lookup_planes {
    _Alignas(64) float x[LOOKUP_LINES][LOOKUP_LINE];
    float y[LOOKUP_LINES][LOOKUP_LINE], w[LOOKUP_LINES][LOOKUP_LINE];
};

/* What is the same for all pixels of a picture. */
struct lookup_view {
    struct splat_place_view v;
    float zoom;                 /* texture_zoom of it */
    float size, half;           /* the picture's side; half the texture's */
};

/* One row of a tile, and what is found for its pixels. */
struct lookup_row {
    const float *x, *y, *w;     /* its first pixel's in the planes */
    float nx, ny, step;         /* normalised position of the first pixel's
                                 * centre, and to the next one's */
    _Alignas(64) float alpha[LOOKUP_WIDE];      /* coverage, beyond the picture
                                                 * anything */
    float inside[LOOKUP_WIDE];  /* texture_inside */
    float sure[LOOKUP_WIDE];    /* confidence, 0 without a place */
    float u[LOOKUP_WIDE], v[LOOKUP_WIDE];   /* places, the texture's pixels */
};

/* x, y, w (n) = offset / weight and weight of place (n,3), zeros where the
 * weight is TEXTURE_LEAST or less; n a multiple of 16.  Whether any has one. */
typedef bool texture_offsets_fn(float *x, float *y, float *w,
                                const float *place, size_t n);

/* row->sure, u and v of n pixels, up to the next multiple of 16, whose
 * neighbours TEXTURE_ACROSS pixels away lie in the picture, too. */
typedef void lookup_confidence_fn(struct lookup_row *row,
                                  const struct lookup_view *k, size_t n);

/* photo (n,5) = texture (S,S,4) at positions (u,v), pixels from the corner, by
 * Keys's bicubic, 0..1, times texture_cover of its matte and the coverage alpha
 * (n), and texture_sure of weight and the same, by texture_rim_at of inside (n);
 * a position's weight of 0 or less leaves its pixel alone.  Border pixels go on
 * outside.  u, v and weight have room for a multiple of 16. */
typedef void texture_bicubic_fn(float *photo, const float *u, const float *v,
                                const float *weight, const float *alpha,
                                const float *inside, size_t n,
                                const uint8_t *texture, size_t S,
                                struct texture_rim rim);

/* texture_mix of n pixels of three channels. */
typedef void texture_mix_fn(float *color, float *alpha, const float *photo,
                            size_t n);

struct lookup_kernels {
    texture_offsets_fn *offsets;
    lookup_confidence_fn *confide;
    texture_bicubic_fn *bicubic;
    texture_mix_fn *mix;
};

/* The widest that the processor has (cpu_level). */
const struct lookup_kernels *lookup_kernels(void);

extern const struct lookup_kernels lookup_kernels_baseline;
#ifdef SPID_X86
extern const struct lookup_kernels lookup_kernels_avx2, lookup_kernels_avx512;
#endif

#endif
