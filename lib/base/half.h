/* Sixteen-bit floats. */
#ifndef SPID_BASE_HALF_H
#define SPID_BASE_HALF_H

#include <stdint.h>

/* IEEE half and bfloat16 conversions, round to nearest even. */
float half_to_float(uint16_t h);
uint16_t float_to_half(float f);
float bf16_to_float(uint16_t h);
uint16_t float_to_bf16(float f);

#endif
