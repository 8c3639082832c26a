/* A vector of as many floats as one register holds: 16 with AVX-512, 8 with
 * AVX2, 4 otherwise.  Wider values than a register are never used: GCC keeps
 * those in memory, at a tenth of the speed.  Private to lib/nn's kernels. */
#ifndef SPID_NN_VECTOR_H
#define SPID_NN_VECTOR_H

#include <stdint.h>
#include <string.h>
#if defined(__SSE2__)
#include <immintrin.h>
#elif defined(__ARM_NEON)
#include <arm_neon.h>
#endif

#include "lib/nn/math.h"

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

/* x, loaded once: GCC would read it again for every use of 128 bits, where no
 * instruction multiplies from an unaligned address. */
VF_INLINE vf vf_keep(vf x)
{
#if VF_LANES == 4 && defined(__SSE2__)
    __asm__("" : "+x"(x));
#endif
    return x;
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
#elif defined(__ARM_NEON)
    return (vf)vbslq_f32((uint32x4_t)(a > b), (float32x4_t)a, (float32x4_t)b);
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
#elif defined(__ARM_NEON)
    return (vf)vbslq_f32((uint32x4_t)(a < b), (float32x4_t)a, (float32x4_t)b);
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
#elif defined(__ARM_NEON)
    return (vf)vcvt_f32_f16(vreinterpret_f16_u16(vld1_u16(p)));
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

/* Two vectors to bfloat16, the upper half of a float, rounded to nearest
 * even. */
VF_INLINE void vf_store_bf16(uint16_t *p, vf a, vf b)
{
    vf_u32 u = (vf_u32)a, v = (vf_u32)b;
    u = u + 0x7fff + ((u >> 16) & 1);
    v = v + 0x7fff + ((v >> 16) & 1);
#if defined(ISA_AVX2)
    __m256i i = _mm256_packs_epi32(_mm256_srai_epi32((__m256i)u, 16),
                                   _mm256_srai_epi32((__m256i)v, 16));
    _mm256_storeu_si256((__m256i *)p, _mm256_permute4x64_epi64(i, 0xd8));
#elif defined(__SSE2__) && !defined(ISA_AVX512)
    _mm_storeu_si128((__m128i *)p,
                     _mm_packs_epi32(_mm_srai_epi32((__m128i)u, 16),
                                     _mm_srai_epi32((__m128i)v, 16)));
#else
    *(vf_u16 *)p = __builtin_convertvector(u >> 16, vf_u16);
    *(vf_u16 *)(p + VF_LANES) = __builtin_convertvector(v >> 16, vf_u16);
#endif
}

/* Two vectors of numbers to bytes: towards zero, then at least 0 and at most
 * 255, which packing does by itself. */
VF_INLINE void vf_store_u8(uint8_t *p, vf a, vf b)
{
#if !(defined(__SSE2__) || defined(__ARM_NEON)) || defined(ISA_AVX512)
    a = vf_min(vf_max(a, vf_set(0)), vf_set(255));
    b = vf_min(vf_max(b, vf_set(0)), vf_set(255));
#endif
    vf_i32 i = __builtin_convertvector(a, vf_i32);
    vf_i32 j = __builtin_convertvector(b, vf_i32);
#if defined(ISA_AVX2)
    __m256i h = _mm256_packs_epi32((__m256i)i, (__m256i)j);
    h = _mm256_permute4x64_epi64(h, 0xd8);
    _mm_storeu_si128((__m128i *)p,
                     _mm_packus_epi16(_mm256_castsi256_si128(h),
                                      _mm256_extracti128_si256(h, 1)));
#elif defined(__SSE2__) && !defined(ISA_AVX512)
    __m128i h = _mm_packs_epi32((__m128i)i, (__m128i)j);
    _mm_storel_epi64((__m128i *)p, _mm_packus_epi16(h, h));
#elif defined(__ARM_NEON)
    vst1_u8(p, vqmovun_s16(vqmovn_high_s32(vqmovn_s32((int32x4_t)i),
                                           (int32x4_t)j)));
#else
    *(vf_u8 *)p = __builtin_convertvector(i, vf_u8);
    *(vf_u8 *)(p + VF_LANES) = __builtin_convertvector(j, vf_u8);
#endif
}

/* e^x, and below the sigmoid and tanh: math.h's, to the bit. */
VF_INLINE vf vf_exp(vf x)
{
    x = vf_max(vf_set(-87.0f), x);
    x = vf_min(vf_set(87.0f), x);
    vf magic = vf_set(12582912.0f);
    vf n = (x * 1.44269504f + magic) - magic;
    vf r = (x - n * 0.693359375f) - n * -2.12194440e-4f;
    vf p = vf_set(1.9875691500e-4f);
    MATH_EXP_SERIES(p, r);
    return p * (vf)((__builtin_convertvector(n, vf_i32) + 127) << 23);
}

/* 1 / (1 + e^-x) */
VF_INLINE vf vf_sigmoid(vf x)
{
    return 1.0f / (1.0f + vf_exp(-x));
}

/* tanh by e^2x */
VF_INLINE vf vf_tanh(vf x)
{
    return 1.0f - 2.0f / (1.0f + vf_exp(2.0f * x));
}

#endif
