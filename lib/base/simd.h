/* Vectors for kernels that are compiled once per instruction set: one vector
 * is one register, of sixteen floats (AVX-512), eight (AVX2) or four (SSE2,
 * NEON, and whatever else GCC's vectors cover).  A wider vector than the
 * registers would be taken apart through memory.  simd_shuffle.h moves numbers
 * between lanes.
 *
 * vf, vi, vu are floats, ints and unsigned ints; C's operators work on them.
 * vm is a mask; its bit or lane i belongs to lane i, and & joins two.  Memory
 * need not be aligned. */
#ifndef SPID_BASE_SIMD_H
#define SPID_BASE_SIMD_H

#include <stdint.h>
#include <string.h>

#if defined(__SSE2__)
#include <immintrin.h>
#elif defined(__ARM_NEON)
#include <arm_neon.h>
#endif

#pragma GCC diagnostic ignored "-Wpsabi"

/* X86(min_ps)(a, b) is the instruction of that name at this width. */
#if defined(ISA_AVX512)
#define VEC 16
#define VEC_ALL(x) x, x, x, x, x, x, x, x, x, x, x, x, x, x, x, x
#define VEC_IOTA 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15
#define X86(name) _mm512_##name
#define X86_F __m512
#define X86_I __m512i
#elif defined(ISA_AVX2)
#define VEC 8
#define VEC_ALL(x) x, x, x, x, x, x, x, x
#define VEC_IOTA 0, 1, 2, 3, 4, 5, 6, 7
#define X86(name) _mm256_##name
#define X86_F __m256
#define X86_I __m256i
#else
#define VEC 4
#define VEC_ALL(x) x, x, x, x
#define VEC_IOTA 0, 1, 2, 3
#ifdef __SSE2__
#define X86(name) _mm_##name
#define X86_F __m128
#define X86_I __m128i
#endif
#endif

#define VEC_QUADS (VEC / 4)
#define VEC_PARTS (16 / VEC)    /* vectors that hold 16 numbers */
#define VEC_INLINE static inline __attribute__((always_inline, unused))
#define VEC_TYPE(type, n) \
    type __attribute__((vector_size((n) * sizeof(type)), may_alias))

typedef VEC_TYPE(float, VEC) vf;
typedef VEC_TYPE(int32_t, VEC) vi;
typedef VEC_TYPE(uint32_t, VEC) vu;
typedef VEC_TYPE(uint16_t, VEC) vh;          /* of half the size, */
typedef VEC_TYPE(uint8_t, VEC) vb;           /* and of a quarter */
typedef VEC_TYPE(float, 4) vq;               /* a quad */
#ifdef ISA_AVX512
typedef __mmask16 vm;
#define VM_ALL ((vm)0xffff)
#else
typedef vi vm;                               /* lanes of 0 or -1 */
#define VM_ALL vi_set(-1)
#endif

VEC_INLINE vf vf_set(float x)
{
    return (vf){VEC_ALL(x)};
}

VEC_INLINE vi vi_set(int32_t x)
{
    return (vi){VEC_ALL(x)};
}

VEC_INLINE vi vi_iota(void)
{
    return (vi){VEC_IOTA};
}

#define VEC_MEMORY(v, scalar)                                                \
    typedef v v##_anywhere __attribute__((aligned(1)));                      \
                                                                             \
    VEC_INLINE v v##_load(const scalar *p)                                   \
    {                                                                        \
        return *(const v##_anywhere *)p;                                     \
    }                                                                        \
                                                                             \
    VEC_INLINE void v##_store(scalar *p, v x)                                \
    {                                                                        \
        *(v##_anywhere *)p = x;                                              \
    }
VEC_MEMORY(vf, float)
VEC_MEMORY(vq, float)
VEC_MEMORY(vi, void)

/* n <= VEC values from p, zeros after them. */
VEC_INLINE vf vf_load_some(const float *p, size_t n)
{
#ifdef ISA_AVX512
    return (vf)_mm512_maskz_loadu_ps((__mmask16)((1u << n) - 1), p);
#else
    float lane[VEC] = {0};

    for (size_t i = 0; i < n; i++)
        lane[i] = p[i];
    return vf_load(lane);
#endif
}

/* The first n <= VEC values of x to p. */
VEC_INLINE void vf_store_some(float *p, vf x, size_t n)
{
#ifdef ISA_AVX512
    _mm512_mask_storeu_ps(p, (__mmask16)((1u << n) - 1), (__m512)x);
#else
    memcpy(p, &x, n * sizeof *p);
#endif
}

/* ---- arithmetic ---------------------------------------------------------- */

VEC_INLINE vf vf_fma(vf a, vf b, vf c)       /* a b + c */
{
#ifdef __FMA__
    return (vf)X86(fmadd_ps)((X86_F)a, (X86_F)b, (X86_F)c);
#else
    return a * b + c;
#endif
}

VEC_INLINE vf vf_fnma(vf a, vf b, vf c)      /* c - a b */
{
#ifdef __FMA__
    return (vf)X86(fnmadd_ps)((X86_F)a, (X86_F)b, (X86_F)c);
#else
    return c - a * b;
#endif
}

VEC_INLINE vf vf_sel(vm m, vf a, vf b)       /* m ? a : b */
{
#if defined(ISA_AVX512)
    return (vf)_mm512_mask_mov_ps((__m512)b, m, (__m512)a);
#elif defined(ISA_AVX2)
    return (vf)_mm256_blendv_ps((__m256)b, (__m256)a, (__m256)m);
#elif defined(__ARM_NEON)
    return (vf)vbslq_f32((uint32x4_t)m, (float32x4_t)a, (float32x4_t)b);
#else
    return (vf)((m & (vi)a) | (~m & (vi)b));
#endif
}

/* a < b ? a : b in each lane, which is what x86's instruction does, also with
 * zeros of either sign and with what is not a number. */
VEC_INLINE vf vf_min(vf a, vf b)
{
#ifdef X86
    return (vf)X86(min_ps)((X86_F)a, (X86_F)b);
#else
    return vf_sel(a < b, a, b);
#endif
}

VEC_INLINE vf vf_max(vf a, vf b)             /* a > b ? a : b */
{
#ifdef X86
    return (vf)X86(max_ps)((X86_F)a, (X86_F)b);
#else
    return vf_sel(a > b, a, b);
#endif
}

/* Of numbers of one sign, not negative: AVX-512 compares them as integers,
 * which more of the processor's units can do. */
VEC_INLINE vf vf_min_positive(vf a, vf b)
{
#ifdef ISA_AVX512
    return (vf)_mm512_min_epi32((__m512i)a, (__m512i)b);
#else
    return vf_min(a, b);
#endif
}

VEC_INLINE vf vf_clamp(vf a, vf lo, vf hi)
{
    return vf_min(vf_max(a, lo), hi);
}

VEC_INLINE vf vf_abs(vf a)
{
    return (vf)((vi)a & 0x7fffffff);
}

VEC_INLINE vf vf_sqrt(vf a)
{
#if defined(X86)
    return (vf)X86(sqrt_ps)((X86_F)a);
#elif defined(__ARM_NEON)
    return (vf)vsqrtq_f32((float32x4_t)a);
#else
    for (int i = 0; i < VEC; i++)
        a[i] = __builtin_sqrtf(a[i]);
    return a;
#endif
}

/* x times 1 + 2^-9 at most, 0 or more, at least sqrt(a); a >= 1e-30 */
VEC_INLINE vf vf_sqrt_above(vf a)
{
#if defined(ISA_AVX512)
    return a * (vf)_mm512_rsqrt14_ps((__m512)a) * vf_set(1 + 0x1p-13f);
#elif defined(X86)
    return a * (vf)X86(rsqrt_ps)((X86_F)a) * vf_set(1 + 0x1p-11f);
#else
    return vf_sqrt(a) * vf_set(1 + 0x1p-13f);
#endif
}

VEC_INLINE vi vf_round(vf a)                 /* to nearest integer */
{
#if defined(X86)
    return (vi)X86(cvtps_epi32)((X86_F)a);
#elif defined(__ARM_NEON)
    return (vi)vcvtnq_s32_f32((float32x4_t)a);
#else
    for (int i = 0; i < VEC; i++)
        a[i] = __builtin_rintf(a[i]);
    return __builtin_convertvector(a, vi);
#endif
}

/* Sum of the lanes, always in the same order. */
VEC_INLINE float vf_sum(vf a)
{
    float s[VEC];

    vf_store(s, a);
    for (int w = VEC / 2; w; w /= 2)
        for (int i = 0; i < w; i++)
            s[i] += s[i + w];
    return s[0];
}

/* from[at[0]], from[at[1]] ... */
VEC_INLINE vf vf_gather(const float *from, vi at)
{
#ifdef ISA_AVX512
    return (vf)_mm512_i32gather_ps((__m512i)at, from, 4);
#else
    vf v;

    for (int k = 0; k < VEC; k++)
        v[k] = from[at[k]];
    return v;
#endif
}

/* ---- masks --------------------------------------------------------------- */

VEC_INLINE vm vf_gt(vf a, vf b)
{
#ifdef ISA_AVX512
    return _mm512_cmp_ps_mask((__m512)a, (__m512)b, _CMP_GT_OQ);
#else
    return a > b;
#endif
}

VEC_INLINE vm vf_ge(vf a, vf b)
{
#ifdef ISA_AVX512
    return _mm512_cmp_ps_mask((__m512)a, (__m512)b, _CMP_GE_OQ);
#else
    return a >= b;
#endif
}

VEC_INLINE vm vf_gt_and(vm m, vf a, vf b)    /* m && a > b */
{
#ifdef ISA_AVX512
    return _mm512_mask_cmp_ps_mask(m, (__m512)a, (__m512)b, _CMP_GT_OQ);
#else
    return m & (a > b);
#endif
}

VEC_INLINE vf vf_keep(vm m, vf a)            /* m ? a : 0 */
{
#ifdef ISA_AVX512
    return (vf)_mm512_maskz_mov_ps(m, (__m512)a);
#else
    return (vf)(m & (vi)a);
#endif
}

/* m ? a b : 0, b finite: where b is waited for, a is masked meanwhile */
VEC_INLINE vf vf_mul_keep(vm m, vf a, vf b)
{
#ifdef ISA_AVX512
    return (vf)_mm512_maskz_mul_ps(m, (__m512)a, (__m512)b);
#else
    return vf_keep(m, a) * b;
#endif
}

VEC_INLINE vf vf_fnma_keep(vm m, vf a, vf b, vf c)  /* m ? c - a b : 0 */
{
#ifdef ISA_AVX512
    return (vf)_mm512_maskz_fnmadd_ps(m, (__m512)a, (__m512)b, (__m512)c);
#else
    return vf_keep(m, vf_fnma(a, b, c));
#endif
}

VEC_INLINE uint32_t vm_bits(vm m)
{
#if defined(ISA_AVX512)
    return m;
#elif defined(X86)
    return (uint32_t)X86(movemask_ps)((X86_F)m);
#elif defined(__ARM_NEON)
    return vaddvq_u32((uint32x4_t)(m & (vi){1, 2, 4, 8}));
#else
    uint32_t bits = 0;

    for (int i = 0; i < VEC; i++)
        bits |= (uint32_t)(m[i] & 1) << i;
    return bits;
#endif
}

VEC_INLINE vm vm_from_bits(uint32_t bits)
{
#ifdef ISA_AVX512
    return (vm)bits;
#else
    static const int32_t lane[] = {1, 2, 4, 8, 16, 32, 64, 128};
    vi own = vi_load(lane);

    return (vi_set((int32_t)bits) & own) == own;
#endif
}

VEC_INLINE int vm_any(vm a)
{
#ifdef ISA_AVX512
    return !_kortestz_mask16_u8(a, a);
#else
    return vm_bits(a) != 0;
#endif
}

/* ---- bytes and halves ---------------------------------------------------- */

/* VEC bytes.  Neither SSE2 nor NEON widens them from memory in one
 * instruction. */
VEC_INLINE vi vi_load_bytes(const void *p)
{
#if defined(ISA_AVX512)
    return (vi)_mm512_cvtepu8_epi32(_mm_loadu_si128(p));
#elif defined(ISA_AVX2)
    return (vi)_mm256_cvtepu8_epi32(_mm_loadl_epi64(p));
#elif VEC == 4 && defined(__SSE2__)
    const __m128i zero = _mm_setzero_si128();
    int32_t four;

    memcpy(&four, p, sizeof four);
    return (vi)_mm_unpacklo_epi16(
        _mm_unpacklo_epi8(_mm_cvtsi32_si128(four), zero), zero);
#elif defined(__ARM_NEON)
    uint32_t four;

    memcpy(&four, p, sizeof four);
    return (vi)vmovl_u16(vget_low_u16(vmovl_u8(vcreate_u8(four))));
#else
    vb bytes;

    memcpy(&bytes, p, sizeof bytes);
    return __builtin_convertvector(bytes, vi);
#endif
}

VEC_INLINE vf vf_load_bytes(const void *p)
{
    return __builtin_convertvector(vi_load_bytes(p), vf);
}

/* To VEC bytes: towards zero, at least 0 and at most 255; what is not a number
 * becomes 0. */
VEC_INLINE void vf_store_bytes(uint8_t *p, vf x)
{
    vi i = __builtin_convertvector(
        vf_min(vf_max(x, vf_set(0)), vf_set(255)), vi);
#if defined(ISA_AVX2)
    __m128i bytes = _mm_packs_epi32(_mm256_castsi256_si128((__m256i)i),
                                    _mm256_extracti128_si256((__m256i)i, 1));

    bytes = _mm_packus_epi16(bytes, bytes);
#elif VEC == 4 && defined(__SSE2__)
    __m128i bytes = _mm_packs_epi32((__m128i)i, (__m128i)i);

    bytes = _mm_packus_epi16(bytes, bytes);
#elif defined(__ARM_NEON)
    uint16x4_t half = vqmovun_s32((int32x4_t)i);
    uint8x8_t bytes = vqmovn_u16(vcombine_u16(half, half));
#else
    vb bytes = __builtin_convertvector(i, vb);
#endif
    memcpy(p, &bytes, sizeof(vb));
}

/* VEC half floats, exactly; what is not a number stays so. */
VEC_INLINE vf vf_load_half(const uint16_t *p)
{
#if defined(ISA_AVX512)
    return (vf)_mm512_cvtph_ps(_mm256_loadu_si256((const __m256i *)p));
#elif defined(ISA_AVX2)
    return (vf)_mm256_cvtph_ps(_mm_loadu_si128((const __m128i *)p));
#elif defined(__ARM_NEON)
    return (vf)vcvt_f32_f16(vreinterpret_f16_u16(vld1_u16(p)));
#else
    vh half;

    memcpy(&half, p, sizeof half);
    vu h = __builtin_convertvector(half, vu), m = h & 0x7fff;
    vu huge = (vu)(m >= 0x7c00);
    vu bits = (m << 13) + 0x38000000 + (huge & 0x38000000);
    vf small = __builtin_convertvector((vi)m, vf) * 0x1p-24f;

    bits = (vu)vf_sel((vi)(m < 0x0400), small, (vf)bits);
    return (vf)(bits | (h & 0x8000) << 16);
#endif
}

/* To VEC half floats, to nearest, ties to even; what is not a number stays
 * so.  Numbers too small for a half's exponent are rounded by adding 1/2,
 * whose last bit is their last. */
VEC_INLINE void vf_store_half(uint16_t *p, vf x)
{
#if defined(ISA_AVX512)
    _mm256_storeu_si256((__m256i *)p, _mm512_cvtps_ph((__m512)x, 0));
#elif defined(ISA_AVX2)
    _mm_storeu_si128((__m128i *)p, _mm256_cvtps_ph((__m256)x, 0));
#elif defined(__ARM_NEON)
    vst1_u16(p, vreinterpret_u16_f16(vcvt_f16_f32((float32x4_t)x)));
#else
    vi bits = (vi)x, a = bits & 0x7fffffff;
    vi normal = (a + 0xfff + (a >> 13 & 1) - 0x38000000) >> 13;
    vi small = (vi)((vf)a + 0.5f) - (vi)vf_set(0.5f);
    vf h = vf_sel(a < 0x38800000, (vf)small, (vf)normal);

    h = vf_sel(a >= 0x477ff000, (vf)vi_set(0x7c00), h);
    h = vf_sel(a > 0x7f800000, (vf)vi_set(0x7e00), h);
    vh half = __builtin_convertvector((vi)h | (bits >> 16 & 0x8000), vh);
    memcpy(p, &half, sizeof half);
#endif
}

#endif
