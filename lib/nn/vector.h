/* Sixteen floats as one value: the compiler splits it where registers are
 * shorter.  Private to lib/nn's kernels. */
#ifndef SPID_NN_VECTOR_H
#define SPID_NN_VECTOR_H

#include <stdint.h>
#include <string.h>
#ifdef __F16C__
#include <immintrin.h>
#endif

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

/* Half floats, exactly; not a number stays one. */
V16_INLINE v16 v16_load_f16(const uint16_t *p)
{
#if defined(__AVX512F__)
    return (v16)_mm512_cvtph_ps(_mm256_loadu_si256((const __m256i *)p));
#elif defined(__F16C__)
    v16 x;
    for (int i = 0; i < 16; i += 8)
        *(__m256 *)((float *)&x + i) =
            _mm256_cvtph_ps(_mm_loadu_si128((const __m128i *)(p + i)));
    return x;
#else
    u16v h = __builtin_convertvector(*(const h16 *)p, u16v), m = h & 0x7fff;
    u16v tiny = (u16v)(m < 0x0400), huge = (u16v)(m >= 0x7c00);
    u16v bits = (m << 13) + 0x38000000 + (huge & 0x38000000);
    v16 small = __builtin_convertvector((i16v)m, v16) * 0x1p-24f;
    bits = (tiny & (u16v)small) | (~tiny & bits);
    return (v16)(bits | (h & 0x8000) << 16);
#endif
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
