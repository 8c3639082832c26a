/* Sixteen floats as one value: the compiler splits it where registers are
 * shorter.  Private to lib/nn's kernels. */
#ifndef SPID_NN_VECTOR_H
#define SPID_NN_VECTOR_H

#include <stdint.h>
#include <string.h>

#pragma GCC diagnostic ignored "-Wpsabi"

typedef float v16 __attribute__((vector_size(64), aligned(4), may_alias));
typedef int32_t i16v __attribute__((vector_size(64), aligned(4), may_alias));
typedef uint32_t u16v __attribute__((vector_size(64), aligned(4), may_alias));
typedef uint16_t h16 __attribute__((vector_size(32), aligned(2), may_alias));

#define V16_INLINE static inline __attribute__((always_inline))

V16_INLINE v16 v16_load(const float *p)
{
    return *(const v16 *)p;
}

V16_INLINE void v16_store(float *p, v16 x)
{
    *(v16 *)p = x;
}

V16_INLINE v16 v16_set(float x)
{
    return x - (v16){ 0 };
}

V16_INLINE v16 v16_max(v16 a, v16 b)
{
    i16v m = a > b;
    return (v16)((m & (i16v)a) | (~m & (i16v)b));
}

V16_INLINE v16 v16_min(v16 a, v16 b)
{
    i16v m = a < b;
    return (v16)((m & (i16v)a) | (~m & (i16v)b));
}

/* bfloat16: the upper half of a float, rounded to nearest even. */
V16_INLINE v16 v16_load_bf16(const uint16_t *p)
{
    return (v16)(__builtin_convertvector(*(const h16 *)p, u16v) << 16);
}

V16_INLINE void v16_store_bf16(uint16_t *p, v16 x)
{
    u16v u = (u16v)x;
    u = (u + 0x7fff + ((u >> 16) & 1)) >> 16;
    *(h16 *)p = __builtin_convertvector(u, h16);
}

#endif
