/* Inside lib/texture: the lookup's inner loop, once per instruction set. */
#ifndef SPID_TEXTURE_LOOKUP_KERNEL_H
#define SPID_TEXTURE_LOOKUP_KERNEL_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/isa.h"

/* out (n,4) = texture (S,S,4) at positions uv (n,2), pixels from the corner,
 * by Catmull and Rom's bicubic, 0..1; a position's weight of 0 or less leaves
 * its pixel alone.  Border pixels go on outside. */
typedef void texture_bicubic_fn(float *out, size_t stride, const float *uv,
                                const float *weight, size_t n,
                                const uint8_t *texture, size_t S);

texture_bicubic_fn texture_bicubic_baseline;
#ifdef SPID_X86
texture_bicubic_fn texture_bicubic_avx2, texture_bicubic_avx512;
#endif

#endif
