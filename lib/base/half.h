/* Sixteen-bit floats. */
#ifndef SPID_BASE_HALF_H
#define SPID_BASE_HALF_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/isa.h"

/* IEEE half and bfloat16 conversions, round to nearest even. */
float half_to_float(uint16_t h);
/* The same of n, many at a time; in at any address. */
typedef void half_widen_fn(float *out, const void *in, size_t n);
half_widen_fn half_to_floats;
ISA_VERSIONS(half_widen_fn, half_widen);
/* To the nearest IEEE half, ties to even; too large is infinity. */
uint16_t float_to_half(float f);
/* Exact: a bfloat16 is the upper half of a float. */
float bf16_to_float(uint16_t h);

#endif
