/* Numbers from lane to lane: transposes, interleaved rows, half floats. */
#ifndef SPID_SPLAT_VEC_SHUFFLE_H
#define SPID_SPLAT_VEC_SHUFFLE_H

#include <stddef.h>

#include "lib/splat/vec.h"

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
#if VEC == 16
    __m512 a = _mm512_unpacklo_ps((__m512)r[0], (__m512)r[1]);
    __m512 b = _mm512_unpackhi_ps((__m512)r[0], (__m512)r[1]);
    __m512 c = _mm512_unpacklo_ps((__m512)r[2], (__m512)r[3]);
    __m512 d = _mm512_unpackhi_ps((__m512)r[2], (__m512)r[3]);

    r[0] = (vf)_mm512_shuffle_ps(a, c, 0x44);
    r[1] = (vf)_mm512_shuffle_ps(a, c, 0xee);
    r[2] = (vf)_mm512_shuffle_ps(b, d, 0x44);
    r[3] = (vf)_mm512_shuffle_ps(b, d, 0xee);
#elif VEC == 8
    __m256 a = _mm256_unpacklo_ps((__m256)r[0], (__m256)r[1]);
    __m256 b = _mm256_unpackhi_ps((__m256)r[0], (__m256)r[1]);
    __m256 c = _mm256_unpacklo_ps((__m256)r[2], (__m256)r[3]);
    __m256 d = _mm256_unpackhi_ps((__m256)r[2], (__m256)r[3]);

    r[0] = (vf)_mm256_shuffle_ps(a, c, 0x44);
    r[1] = (vf)_mm256_shuffle_ps(a, c, 0xee);
    r[2] = (vf)_mm256_shuffle_ps(b, d, 0x44);
    r[3] = (vf)_mm256_shuffle_ps(b, d, 0xee);
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
#if VEC == 16
    /* number k of the result is of the first, the second (16 and on), or where
     * blue has a bit of the third */
    const __m512i two[3] = {
        _mm512_setr_epi32(0, 16, 0, 1, 17, 0, 2, 18, 0, 3, 19, 0, 4, 20, 0, 5),
        _mm512_setr_epi32(21, 0, 6, 22, 0, 7, 23, 0,
                          8, 24, 0, 9, 25, 0, 10, 26),
        _mm512_setr_epi32(0, 11, 27, 0, 12, 28, 0, 13,
                          29, 0, 14, 30, 0, 15, 31, 0)};
    const __m512i third[3] = {
        _mm512_setr_epi32(0, 0, 0, 0, 0, 1, 0, 0, 2, 0, 0, 3, 0, 0, 4, 0),
        _mm512_setr_epi32(0, 5, 0, 0, 6, 0, 0, 7, 0, 0, 8, 0, 0, 9, 0, 0),
        _mm512_setr_epi32(10, 0, 0, 11, 0, 0, 12, 0,
                          0, 13, 0, 0, 14, 0, 0, 15)};
    static const __mmask16 blue[3] = {0x4924, 0x2492, 0x9249};

    for (int j = 0; j < 3; j++)
        vf_store(to + VEC * j, (vf)_mm512_mask_permutexvar_ps(
            _mm512_permutex2var_ps((__m512)v[0], two[j], (__m512)v[1]),
            blue[j], third[j], (__m512)v[2]));
#elif VEC == 8
    vq_put_rgb(to, vf_quad(v[0], 0), vf_quad(v[1], 0), vf_quad(v[2], 0));
    vq_put_rgb(to + 12, vf_quad(v[0], 1), vf_quad(v[1], 1), vf_quad(v[2], 1));
#else
    vq_put_rgb(to, v[0], v[1], v[2]);
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
        for (int k = 0; k < 4; k++) {
            vq_store(to + 4 * k, vf_quad(r[k], 0));
#if VEC > 4
            vq_store(to + 16 + 4 * k, vf_quad(r[k], 1));
#endif
#if VEC > 8
            vq_store(to + 32 + 4 * k, vf_quad(r[k], 2));
            vq_store(to + 48 + 4 * k, vf_quad(r[k], 3));
#endif
        }
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

/* To VEC half floats, to nearest, ties to even; finite numbers. */
VEC_INLINE void vf_store_half(uint16_t *to, vf x)
{
#if VEC == 16
    _mm256_storeu_si256((__m256i *)to, _mm512_cvtps_ph((__m512)x, 0));
#elif VEC == 8
    _mm_storeu_si128((__m128i *)to, _mm256_cvtps_ph((__m256)x, 0));
#elif defined(__ARM_NEON)
    vst1_u16(to, vreinterpret_u16_f16(vcvt_f16_f32((float32x4_t)x)));
#else
    typedef uint16_t vh __attribute__((vector_size(8)));
    const vf half = vf_set(0.5f);
    vu bits = (vu)x, a = bits & 0x7fffffff;
    vu normal = (a + 0xfff + (a >> 13 & 1) - 0x38000000) >> 13;
    vu small = (vu)((vf)a + half) - (vu)half;    /* rounds at 2^-24 */
    vu h = (vu)vf_sel((vi)a < 0x38800000, (vf)small, (vf)normal);

    h = (vu)vf_sel((vi)a >= 0x477ff000, (vf)(vu){VEC_ALL(0x7c00)}, (vf)h);
    vh out = __builtin_convertvector(h | (bits >> 16 & 0x8000), vh);

    memcpy(to, &out, sizeof out);
#endif
}

#endif
