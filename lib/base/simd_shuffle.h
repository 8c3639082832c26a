/* Numbers from lane to lane of simd.h's vectors: transposes, lists, interleaved
 * rows. */
#ifndef SPID_BASE_SIMD_SHUFFLE_H
#define SPID_BASE_SIMD_SHUFFLE_H

#include <stddef.h>

#include "lib/base/simd.h"

/* Four by four: r[i] lane j <-> r[j] lane i. */
VEC_INLINE void vq_transpose(vq r[4])
{
    vq a = __builtin_shufflevector(r[0], r[1], 0, 4, 1, 5);
    vq b = __builtin_shufflevector(r[0], r[1], 2, 6, 3, 7);
    vq c = __builtin_shufflevector(r[2], r[3], 0, 4, 1, 5);
    vq d = __builtin_shufflevector(r[2], r[3], 2, 6, 3, 7);

    r[0] = __builtin_shufflevector(a, c, 0, 1, 4, 5);
    r[1] = __builtin_shufflevector(a, c, 2, 3, 6, 7);
    r[2] = __builtin_shufflevector(b, d, 0, 1, 4, 5);
    r[3] = __builtin_shufflevector(b, d, 2, 3, 6, 7);
}

/* Four by four in each quad of lanes: r[i] lane 4k + j <-> r[j] lane 4k + i. */
VEC_INLINE void vf_transpose_quads(vf r[4])
{
#if VEC > 4
    X86_F a = X86(unpacklo_ps)((X86_F)r[0], (X86_F)r[1]);
    X86_F b = X86(unpackhi_ps)((X86_F)r[0], (X86_F)r[1]);
    X86_F c = X86(unpacklo_ps)((X86_F)r[2], (X86_F)r[3]);
    X86_F d = X86(unpackhi_ps)((X86_F)r[2], (X86_F)r[3]);

    r[0] = (vf)X86(shuffle_ps)(a, c, 0x44);
    r[1] = (vf)X86(shuffle_ps)(a, c, 0xee);
    r[2] = (vf)X86(shuffle_ps)(b, d, 0x44);
    r[3] = (vf)X86(shuffle_ps)(b, d, 0xee);
#else
    vq_transpose(r);
#endif
}

#if VEC == 16
/* Four by four in quads of floats: r[i] quad j <-> r[j] quad i. */
VEC_INLINE void vf_swap_quads(vf r[4])
{
    __m512 a = _mm512_shuffle_f32x4((__m512)r[0], (__m512)r[1], 0x44);
    __m512 b = _mm512_shuffle_f32x4((__m512)r[0], (__m512)r[1], 0xee);
    __m512 c = _mm512_shuffle_f32x4((__m512)r[2], (__m512)r[3], 0x44);
    __m512 d = _mm512_shuffle_f32x4((__m512)r[2], (__m512)r[3], 0xee);

    r[0] = (vf)_mm512_shuffle_f32x4(a, c, 0x88);
    r[1] = (vf)_mm512_shuffle_f32x4(a, c, 0xdd);
    r[2] = (vf)_mm512_shuffle_f32x4(b, d, 0x88);
    r[3] = (vf)_mm512_shuffle_f32x4(b, d, 0xdd);
}
#endif

/* Quad k of v, a constant. */
#if VEC == 16
#define vf_quad(v, k) ((vq)_mm512_extractf32x4_ps((__m512)(v), k))
#elif VEC == 8
#define vf_quad(v, k) ((vq)_mm256_extractf128_ps((__m256)(v), k))
#else
#define vf_quad(v, k) (v)
#endif

/* The quads of v to `to`, `stride` numbers apart. */
VEC_INLINE void vf_put_quads(float *to, const size_t stride, vf v)
{
    vq_store(to, vf_quad(v, 0));
#if VEC > 4
    vq_store(to + stride, vf_quad(v, 1));
#else
    (void)stride;
#endif
#if VEC > 8
    vq_store(to + 2 * stride, vf_quad(v, 2));
    vq_store(to + 3 * stride, vf_quad(v, 3));
#endif
}

/* Four floats, as often as they fit. */
VEC_INLINE vf vf_repeat(const float *p)
{
#if defined(ISA_AVX512)
    return (vf)_mm512_broadcast_f32x4(_mm_loadu_ps(p));
#elif defined(ISA_AVX2)
    return (vf)_mm256_broadcast_ps((const __m128 *)p);
#else
    return vf_load(p);
#endif
}

/* Quads side by side: those at from[0], from[stride] ... */
VEC_INLINE vf vf_join(const float *const *from, const size_t stride)
{
#if VEC == 16
    __m512 x = _mm512_castps128_ps512(_mm_loadu_ps(from[0]));

    x = _mm512_insertf32x4(x, _mm_loadu_ps(from[stride]), 1);
    x = _mm512_insertf32x4(x, _mm_loadu_ps(from[2 * stride]), 2);
    return (vf)_mm512_insertf32x4(x, _mm_loadu_ps(from[3 * stride]), 3);
#elif VEC == 8
    return (vf)_mm256_insertf128_ps(
        _mm256_castps128_ps256(_mm_loadu_ps(from[0])),
        _mm_loadu_ps(from[stride]), 1);
#else
    (void)stride;
    return vf_load(from[0]);
#endif
}

/* Columns of VEC rows, whose quads are `quads` or fewer: lane n of out[c] is
 * row[n][c]. */
VEC_INLINE void vf_columns(vf *out, const float *const row[VEC],
                           const int quads)
{
#pragma GCC unroll 4
    for (int q = 0; q < quads; q++) {
        const float *part[VEC];

#pragma GCC unroll 16
        for (int n = 0; n < VEC; n++)
            part[n] = row[n] + 4 * q;
#pragma GCC unroll 4
        for (int k = 0; k < 4; k++)
            out[4 * q + k] = vf_join(part + k, 4);
        vf_transpose_quads(out + 4 * q);
    }
}

/* Three planes of a quad of pixels to rows of three. */
VEC_INLINE void vq_put_rgb(float *to, vq r, vq g, vq b)
{
    vq low = __builtin_shufflevector(r, g, 0, 4, 1, 5);      /* r0 g0 r1 g1 */
    vq high = __builtin_shufflevector(r, g, 2, 6, 3, 7);
    vq mid = __builtin_shufflevector(low, b, 3, 5, 3, 5);    /* g1 b1 */

    vq_store(to, __builtin_shufflevector(low, b, 0, 1, 4, 2));
    vq_store(to + 4, __builtin_shufflevector(mid, high, 0, 1, 4, 5));
    vq_store(to + 8, __builtin_shufflevector(high, b, 6, 2, 3, 7));
}

/* VEC rows of three numbers: lane n of v[k] is number k of row n. */
VEC_INLINE void vf_put_rgb(float *to, const vf v[3])
{
    vq_put_rgb(to, vf_quad(v[0], 0), vf_quad(v[1], 0), vf_quad(v[2], 0));
#if VEC > 4
    vq_put_rgb(to + 12, vf_quad(v[0], 1), vf_quad(v[1], 1), vf_quad(v[2], 1));
#endif
#if VEC > 8
    vq_put_rgb(to + 24, vf_quad(v[0], 2), vf_quad(v[1], 2), vf_quad(v[2], 2));
    vq_put_rgb(to + 36, vf_quad(v[0], 3), vf_quad(v[1], 3), vf_quad(v[2], 3));
#endif
}

/* VEC rows of `width` numbers, 1 to 4: lane n of v[k] is number k of row n. */
VEC_INLINE void vf_put_rows(float *to, const vf v[4], const size_t width)
{
    if (width == 1) {
        vf_store(to, v[0]);
    } else if (width == 2) {
        for (size_t n = 0; n < VEC; n++) {
            to[2 * n] = v[0][n];
            to[2 * n + 1] = v[1][n];
        }
    } else if (width == 3) {
        vf_put_rgb(to, v);
    } else {
        vf r[4] = {v[0], v[1], v[2], v[3]};

        vf_transpose_quads(r);
#pragma GCC unroll 4
        for (int k = 0; k < 4; k++)
            vf_put_quads(to + 4 * k, 16, r[k]);
    }
}

/* VEC pairs of numbers: lane n of a, lane n of b. */
VEC_INLINE void vi_put_pairs(void *to, vi a, vi b)
{
#if VEC == 16
    const __m512i low = _mm512_setr_epi32(0, 16, 1, 17, 2, 18, 3, 19,
                                          4, 20, 5, 21, 6, 22, 7, 23);
    __m512i high = _mm512_add_epi32(low, _mm512_set1_epi32(8));

    vi_store(to, (vi)_mm512_permutex2var_epi32((__m512i)a, low, (__m512i)b));
    vi_store((char *)to + 64,
             (vi)_mm512_permutex2var_epi32((__m512i)a, high, (__m512i)b));
#elif VEC == 8
    __m256i low = _mm256_unpacklo_epi32((__m256i)a, (__m256i)b);
    __m256i high = _mm256_unpackhi_epi32((__m256i)a, (__m256i)b);

    vi_store(to, (vi)_mm256_permute2x128_si256(low, high, 0x20));
    vi_store((char *)to + 32, (vi)_mm256_permute2x128_si256(low, high, 0x31));
#else
    vi_store(to, __builtin_shufflevector(a, b, 0, 4, 1, 5));
    vi_store((char *)to + 16, __builtin_shufflevector(a, b, 2, 6, 3, 7));
#endif
}

/* The numbers of the bits that are set in 0..255, in order, a byte each. */
#define BIT(m, k) ((uint64_t)(m) >> (k) & 1)
#define BELOW(m, k) (8 * __builtin_popcount((m) & ((1 << (k)) - 1)))
#define LIST(m)                                                          \
    (BIT(m, 1) << BELOW(m, 1) | BIT(m, 2) * 2 << BELOW(m, 2) |           \
     BIT(m, 3) * 3 << BELOW(m, 3) | BIT(m, 4) * 4 << BELOW(m, 4) |       \
     BIT(m, 5) * 5 << BELOW(m, 5) | BIT(m, 6) * 6 << BELOW(m, 6) |       \
     BIT(m, 7) * 7 << BELOW(m, 7))
#define LIST4(m) LIST(m), LIST((m) + 1), LIST((m) + 2), LIST((m) + 3)
#define LIST16(m) LIST4(m), LIST4((m) + 4), LIST4((m) + 8), LIST4((m) + 12)

#if VEC < 16
static const uint64_t vec_lists[] __attribute__((unused)) = {
    LIST16(0),
#if VEC == 8
    LIST16(16), LIST16(32), LIST16(48), LIST16(64), LIST16(80), LIST16(96),
    LIST16(112), LIST16(128), LIST16(144), LIST16(160), LIST16(176),
    LIST16(192), LIST16(208), LIST16(224), LIST16(240)
#endif
};
#endif

/* at + the number of each lane in m to p, in order; returns how many.  VEC are
 * written. */
VEC_INLINE uint32_t vm_list(uint32_t *p, vm m, uint32_t at)
{
    const vi first = vi_set((int32_t)at);
    const uint32_t bits = vm_bits(m);

#ifdef ISA_AVX512
    vi_store(p, (vi)_mm512_maskz_compress_epi32(m, (__m512i)(vi_iota() +
                                                             first)));
#else
    vi_store(p, vi_load_bytes(&vec_lists[bits]) + first);
#endif
#if VEC > 4
    return (uint32_t)__builtin_popcount(bits);
#else
    return (uint32_t)(0x4332322132212110 >> 4 * bits) & 15;
#endif
}

#endif
