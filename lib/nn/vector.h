/* A vector of as many floats as one register holds: 16 with AVX-512, 8 with
 * AVX2, 4 otherwise.  Wider values than a register are never used: GCC keeps
 * those in memory, at a tenth of the speed.  Private to lib/nn's kernels. */
#ifndef SPID_NN_VECTOR_H
#define SPID_NN_VECTOR_H

#include <stdint.h>
#include <string.h>
#ifdef __SSE2__
#include <immintrin.h>
#endif

#if defined(ISA_AVX512)
#define VF_LANES 16
#elif defined(ISA_AVX2)
#define VF_LANES 8
#else
#define VF_LANES 4
#endif
/* Vectors that hold 16 channels, the unit that layers are planned in. */
#define VF_PARTS (16 / VF_LANES)

#define VF_TYPE(type)                                                        \
    type __attribute__((vector_size(VF_LANES * sizeof(type)),                \
                        aligned(sizeof(type)), may_alias))

typedef VF_TYPE(float) vf;
typedef VF_TYPE(int32_t) vf_i32;
typedef VF_TYPE(uint32_t) vf_u32;
typedef VF_TYPE(uint16_t) vf_u16;
typedef VF_TYPE(uint8_t) vf_u8;

#define VF_INLINE static inline __attribute__((always_inline))

/* VF_LANES values from p, which need not be aligned. */
VF_INLINE vf vf_load(const float *p)
{
    return *(const vf *)p;
}

/* VF_LANES values to p, which need not be aligned. */
VF_INLINE void vf_store(float *p, vf x)
{
    *(vf *)p = x;
}

/* x in every lane. */
VF_INLINE vf vf_set(float x)
{
    return x - (vf){ 0 };
}

/* a > b ? a : b in each lane, which is what the instruction does, also with
 * zeros of either sign and with what is not a number. */
VF_INLINE vf vf_max(vf a, vf b)
{
#if defined(ISA_AVX512)
    return (vf)_mm512_max_ps((__m512)a, (__m512)b);
#elif defined(ISA_AVX2)
    return (vf)_mm256_max_ps((__m256)a, (__m256)b);
#elif defined(__SSE2__)
    return (vf)_mm_max_ps((__m128)a, (__m128)b);
#else
    vf_i32 m = a > b;
    return (vf)((m & (vf_i32)a) | (~m & (vf_i32)b));
#endif
}

/* a < b ? a : b in each lane. */
VF_INLINE vf vf_min(vf a, vf b)
{
#if defined(ISA_AVX512)
    return (vf)_mm512_min_ps((__m512)a, (__m512)b);
#elif defined(ISA_AVX2)
    return (vf)_mm256_min_ps((__m256)a, (__m256)b);
#elif defined(__SSE2__)
    return (vf)_mm_min_ps((__m128)a, (__m128)b);
#else
    vf_i32 m = a < b;
    return (vf)((m & (vf_i32)a) | (~m & (vf_i32)b));
#endif
}

/* Half floats, exactly; not a number stays one. */
VF_INLINE vf vf_load_f16(const uint16_t *p)
{
#if defined(ISA_AVX512)
    return (vf)_mm512_cvtph_ps(_mm256_loadu_si256((const __m256i *)p));
#elif defined(ISA_AVX2)
    return (vf)_mm256_cvtph_ps(_mm_loadu_si128((const __m128i *)p));
#else
    vf_u32 h = __builtin_convertvector(*(const vf_u16 *)p, vf_u32);
    vf_u32 m = h & 0x7fff;
    vf_u32 tiny = (vf_u32)(m < 0x0400), huge = (vf_u32)(m >= 0x7c00);
    vf_u32 bits = (m << 13) + 0x38000000 + (huge & 0x38000000);
    vf small = __builtin_convertvector((vf_i32)m, vf) * 0x1p-24f;
    bits = (tiny & (vf_u32)small) | (~tiny & bits);
    return (vf)(bits | (h & 0x8000) << 16);
#endif
}

/* To bfloat16, the upper half of a float, rounded to nearest even. */
VF_INLINE void vf_store_bf16(uint16_t *p, vf x)
{
    vf_u32 u = (vf_u32)x;
    u = (u + 0x7fff + ((u >> 16) & 1)) >> 16;
    *(vf_u16 *)p = __builtin_convertvector(u, vf_u16);
}

#endif
