/* Rendered colours to bytes: the inner loops of framesink_compose. */
#ifndef SPID_FORMATS_COMPOSE_H
#define SPID_FORMATS_COMPOSE_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/isa.h"

struct compose_kernels {
    /* out (n,3) = round(255 clamp(color + (1 - alpha) bg)) for n pixels.
     *   color (n,3)  in  0..1, alpha-weighted; NaN becomes 0
     *   alpha (n)    in  0..1
     *   bg    (n,3)  in  0..255, or one (3) for all when bg_step is 0 (else 3)
     * Versions agree within one level: tests/unit/framesink_compose.c. */
    void (*blend)(uint8_t *out, const float *color, const float *alpha,
                  const uint8_t *bg, size_t bg_step, size_t n);
    /* out (n) = round(255 clamp(x)) */
    void (*quantise)(uint8_t *out, const float *x, size_t n);
    /* out (n) = IEEE half of x, to nearest even */
    void (*half)(uint16_t *out, const float *x, size_t n);
    /* plane[j] (n) = clamp((m[j][0] r + m[j][1] g + m[j][2] b + m[j][3]) >>
     * 16) of rgb (n,3): Y4M's three planes */
    void (*planes)(uint8_t *const plane[3], const uint8_t *rgb, size_t n,
                   const int32_t m[3][4]);
    /* rgb (n,3): channel j = clamp((m[j][0] y + m[j][1] u + m[j][2] v +
     * m[j][3]) >> 16) of luma y (n) and chroma u, v (n): the reverse */
    void (*rgb)(uint8_t *rgb, const uint8_t *luma, const int16_t *u,
                const int16_t *v, size_t n, const int32_t m[3][4]);
};

ISA_VERSIONS(const struct compose_kernels, compose_kernels);

/* Plainly, one number at a time: for what is left of a row, and for tests. */
void compose_c(uint8_t *out, const float *color, const float *alpha,
               const uint8_t *bg, size_t bg_step, size_t n);
/* quantise likewise, ... */
void compose_quantise_c(uint8_t *out, const float *x, size_t n);
/* ... half ... */
void compose_half_c(uint16_t *out, const float *x, size_t n);
/* ... planes ... */
void compose_planes_c(uint8_t *const plane[3], const uint8_t *rgb, size_t n,
                      const int32_t m[3][4]);
/* ... and rgb. */
void compose_rgb_c(uint8_t *rgb, const uint8_t *luma, const int16_t *u,
                   const int16_t *v, size_t n, const int32_t m[3][4]);

#endif
