/* The inner loops of crop_sample_u8 and crop_resize_u8, one version per
 * instruction set. */
#ifndef SPID_BASE_CROP_KERNEL_H
#define SPID_BASE_CROP_KERNEL_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/isa.h"

/* row (n) = a + (b - a) w, scaled from bytes to [0,1]. */
typedef void crop_blend_fn(float *row, const uint8_t *a, const uint8_t *b,
                           float w, size_t n);
/* out (n,3): pixel i is row[at[i]..] + (row[at[i] + 3..] - row[at[i]..]) w[i];
 * row must have 4 floats more than the last read; out one float more. */
typedef void crop_gather_fn(float *out, const float *row, const int32_t *at,
                            const float *w, size_t n);
/* out (w,3) = 2x2 means of rows a and b of 2w pixels. */
typedef void crop_halve_fn(uint8_t *out, const uint8_t *a, const uint8_t *b,
                           size_t w);
/* sum (n) += w times bytes. */
typedef void crop_add_fn(float *sum, const uint8_t *in, float w, size_t n);
/* out (n) = the bytes that are nearest. */
typedef void crop_round_fn(uint8_t *out, const float *in, size_t n);

crop_blend_fn crop_blend_baseline;
crop_gather_fn crop_gather_baseline;
crop_halve_fn crop_halve_baseline;
crop_add_fn crop_add_baseline;
crop_round_fn crop_round_baseline;
#ifdef SPID_X86
crop_blend_fn crop_blend_avx2, crop_blend_avx512;
crop_gather_fn crop_gather_avx2, crop_gather_avx512;
crop_halve_fn crop_halve_avx2, crop_halve_avx512;
crop_add_fn crop_add_avx2, crop_add_avx512;
crop_round_fn crop_round_avx2, crop_round_avx512;
#endif

#endif
