/* The inner loops of crop_sample_u8 and crop_resize_u8, one version per
 * instruction set. */
#ifndef SPID_BASE_CROP_KERNEL_H
#define SPID_BASE_CROP_KERNEL_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/isa.h"

struct crop_kernels {
    /* row (n) = a + (b - a) w, scaled from bytes to [0,1] */
    void (*blend)(float *row, const uint8_t *a, const uint8_t *b, float w,
                  size_t n);
    /* out (n,3): pixel i is row[at[i]..] + (row[at[i] + 3..] - row[at[i]..])
     * w[i]; row must have 4 floats more than the last read; out one float
     * more */
    void (*gather)(float *out, const float *row, const int32_t *at,
                   const float *w, size_t n);
    /* out (w,3) = 2x2 means of rows a and b of 2w pixels */
    void (*halve)(uint8_t *out, const uint8_t *a, const uint8_t *b, size_t w);
    /* sum (n) += w times bytes */
    void (*add)(float *sum, const uint8_t *in, float w, size_t n);
    /* out (n) = the bytes that are nearest */
    void (*round)(uint8_t *out, const float *in, size_t n);
};

ISA_VERSIONS(const struct crop_kernels, crop_kernels);

#endif
