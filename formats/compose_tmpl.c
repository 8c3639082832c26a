/* Rendered colours to bytes, floats to half precision and back: a vector of
 * numbers at a time, as wide as the instruction set's registers for it. */
#include "formats/compose.h"

#include <string.h>

#if defined(__SSE2__)
#include <immintrin.h>
#elif defined(__ARM_NEON)
#include <arm_neon.h>
#endif

#if defined(ISA_BASELINE)
enum { LANES = 4 };
#else
enum { LANES = 8 };
#endif

typedef float vf __attribute__((vector_size(4 * LANES)));
typedef int32_t vi __attribute__((vector_size(4 * LANES)));
typedef uint8_t vb __attribute__((vector_size(LANES)));

static inline vf compose_load(const float *p)
{
    vf v;

    memcpy(&v, p, sizeof v);
    return v;
}

/* As many bytes as a vector has lanes, as floats: neither SSE2 nor NEON does
 * it from memory in one instruction. */
static inline vf compose_load_bytes(const uint8_t *p)
{
#if defined(ISA_BASELINE) && defined(__SSE2__)
    __m128i zero = _mm_setzero_si128();
    int32_t four;

    memcpy(&four, p, sizeof four);
    __m128i wide = _mm_unpacklo_epi8(_mm_cvtsi32_si128(four), zero);

    return (vf)_mm_cvtepi32_ps(_mm_unpacklo_epi16(wide, zero));
#elif defined(__ARM_NEON)
    uint32_t four;

    memcpy(&four, p, sizeof four);
    uint16x8_t wide = vmovl_u8(vcreate_u8(four));

    return (vf)vcvtq_f32_u32(vmovl_u16(vget_low_u16(wide)));
#else
    vb v;

    memcpy(&v, p, sizeof v);
    return __builtin_convertvector(v, vf);
#endif
}

/* x in levels, rounded and clamped; NaN becomes 0 (maxps keeps its second,
 * and NEON's conversion to unsigned makes 0 of it as of what is negative). */
static inline void compose_store_bytes(uint8_t *p, vf x)
{
#if defined(ISA_BASELINE) && defined(__SSE2__)
    __m128 v = _mm_max_ps(x + 0.5f, _mm_setzero_ps());
    __m128i i = _mm_cvttps_epi32(_mm_min_ps(v, _mm_set1_ps(255)));
    __m128i h = _mm_packs_epi32(i, i);
    int32_t four = _mm_cvtsi128_si32(_mm_packus_epi16(h, h));

    memcpy(p, &four, sizeof four);
#elif defined(__ARM_NEON)
    uint16x4_t h = vqmovn_u32(vcvtq_u32_f32((float32x4_t)(x + 0.5f)));
    uint8x8_t b = vqmovn_u16(vcombine_u16(h, h));

    uint32_t four = vget_lane_u32(vreinterpret_u32_u8(b), 0);

    memcpy(p, &four, sizeof four);
#elif defined(ISA_AVX2)
    __m256 v = _mm256_max_ps(x + 0.5f, _mm256_setzero_ps());
    __m256i i = _mm256_cvttps_epi32(_mm256_min_ps(v, _mm256_set1_ps(255)));
    __m128i h = _mm_packs_epi32(_mm256_castsi256_si128(i),
                                _mm256_extracti128_si256(i, 1));

    _mm_storel_epi64((__m128i *)p, _mm_packus_epi16(h, h));
#elif defined(ISA_AVX512)
    __m256 v = _mm256_max_ps(x + 0.5f, _mm256_setzero_ps());
    __m256i i = _mm256_cvttps_epi32(_mm256_min_ps(v, _mm256_set1_ps(255)));

    _mm_storel_epi64((__m128i *)p, _mm256_cvtepi32_epi8(i));
#else
    for (int k = 0; k < LANES; k++) {
        float v = x[k] + 0.5f;

        p[k] = !(v > 0) ? 0 : v < 255 ? (uint8_t)v : 255;
    }
#endif
}

/* What belongs to the values of vector k of three: value i is of pixel i / 3.
 * k is a constant. */
static inline vf compose_spread(vf t, size_t k)
{
#if defined(ISA_BASELINE)
    return k == 0   ? __builtin_shufflevector(t, t, 0, 0, 0, 1)
           : k == 1 ? __builtin_shufflevector(t, t, 1, 1, 2, 2)
                    : __builtin_shufflevector(t, t, 2, 3, 3, 3);
#else
    return k == 0   ? __builtin_shufflevector(t, t, 0, 0, 0, 1, 1, 1, 2, 2)
           : k == 1 ? __builtin_shufflevector(t, t, 2, 3, 3, 3, 4, 4, 4, 5)
                    : __builtin_shufflevector(t, t, 5, 5, 6, 6, 6, 7, 7, 7);
#endif
}

static void compose_blend(uint8_t *out, const float *color,
                          const float *alpha, const uint8_t *bg,
                          size_t bg_step, size_t n)
{
    uint8_t fill[3 * LANES];
    size_t i = 0;

    for (int k = 0; k < 3 * LANES && bg_step == 0; k++)
        fill[k] = bg[k % 3];
    for (; i + LANES <= n; i += LANES) {
        const uint8_t *b = bg_step ? bg + 3 * i : fill;

        vf t = 1.0f - compose_load(alpha + i);

#pragma GCC unroll 3
        for (size_t k = 0; k < 3; k++)
            compose_store_bytes(out + 3 * i + LANES * k,
                                255.0f * compose_load(color + 3 * i +
                                                      LANES * k) +
                                compose_spread(t, k) *
                                compose_load_bytes(b + LANES * k));
    }
    compose_c(out + 3 * i, color + 3 * i, alpha + i, bg + bg_step * i,
              bg_step, n - i);
}

static void compose_quantise(uint8_t *out, const float *x, size_t n)
{
    size_t i = 0;

    for (; i + LANES <= n; i += LANES)
        compose_store_bytes(out + i, compose_load(x + i) * 255.0f);
    compose_quantise_c(out + i, x + i, n - i);
}

/* ---- planes -------------------------------------------------------------- */

#if !defined(ISA_BASELINE)
/* Red, green and blue of eight pixels: what of the first sixteen bytes and of
 * the last eight each one takes. */
static inline void compose_channels(__m256i c[3], const uint8_t *rgb)
{
    const __m128i first = _mm_loadu_si128((const __m128i *)rgb);
    const __m128i last = _mm_loadl_epi64((const __m128i *)(rgb + 16));
    const __m128i from[3][2] = {
        {_mm_setr_epi8(0, 3, 6, 9, 12, 15, -1, -1,
                       -1, -1, -1, -1, -1, -1, -1, -1),
         _mm_setr_epi8(-1, -1, -1, -1, -1, -1, 2, 5,
                       -1, -1, -1, -1, -1, -1, -1, -1)},
        {_mm_setr_epi8(1, 4, 7, 10, 13, -1, -1, -1,
                       -1, -1, -1, -1, -1, -1, -1, -1),
         _mm_setr_epi8(-1, -1, -1, -1, -1, 0, 3, 6,
                       -1, -1, -1, -1, -1, -1, -1, -1)},
        {_mm_setr_epi8(2, 5, 8, 11, 14, -1, -1, -1,
                       -1, -1, -1, -1, -1, -1, -1, -1),
         _mm_setr_epi8(-1, -1, -1, -1, -1, 1, 4, 7,
                       -1, -1, -1, -1, -1, -1, -1, -1)}};

    for (int k = 0; k < 3; k++)
        c[k] = _mm256_cvtepu8_epi32(
            _mm_or_si128(_mm_shuffle_epi8(first, from[k][0]),
                         _mm_shuffle_epi8(last, from[k][1])));
}

/* Eight numbers as bytes, clamped. */
static inline __m128i compose_clamp_bytes(vi v)
{
    const __m128i h = _mm_packs_epi32(_mm256_castsi256_si128((__m256i)v),
                                      _mm256_extracti128_si256((__m256i)v, 1));

    return _mm_packus_epi16(h, h);
}

static void compose_planes(uint8_t *const plane[3], const uint8_t *rgb,
                           size_t n, const int32_t m[3][4])
{
    size_t i = 0;

    for (; i + 8 <= n; i += 8) {
        __m256i c[3];

        compose_channels(c, rgb + 3 * i);
        for (int j = 0; j < 3; j++) {
            vi v = (m[j][0] * (vi)c[0] + m[j][1] * (vi)c[1] +
                    m[j][2] * (vi)c[2] + m[j][3]) >> 16;

            _mm_storel_epi64((__m128i *)(plane[j] + i),
                             compose_clamp_bytes(v));
        }
    }
    compose_planes_c((uint8_t *[3]){plane[0] + i, plane[1] + i, plane[2] + i},
                     rgb + 3 * i, n - i, m);
}

/* Eight pixels from their channels' bytes: the first sixteen bytes, and the
 * last eight. */
static inline void compose_store_pixels(uint8_t *rgb, const __m128i c[3])
{
    const __m128i rg = _mm_unpacklo_epi8(c[0], c[1]);
    const __m128i first[2] = {
        _mm_setr_epi8(0, 1, -1, 2, 3, -1, 4, 5, -1, 6, 7, -1, 8, 9, -1, 10),
        _mm_setr_epi8(-1, -1, 0, -1, -1, 1, -1, -1, 2, -1, -1, 3, -1, -1, 4,
                      -1)};
    const __m128i last[2] = {
        _mm_setr_epi8(11, -1, 12, 13, -1, 14, 15, -1,
                      -1, -1, -1, -1, -1, -1, -1, -1),
        _mm_setr_epi8(-1, 5, -1, -1, 6, -1, -1, 7,
                      -1, -1, -1, -1, -1, -1, -1, -1)};

    _mm_storeu_si128((__m128i *)rgb,
                     _mm_or_si128(_mm_shuffle_epi8(rg, first[0]),
                                  _mm_shuffle_epi8(c[2], first[1])));
    _mm_storel_epi64((__m128i *)(rgb + 16),
                     _mm_or_si128(_mm_shuffle_epi8(rg, last[0]),
                                  _mm_shuffle_epi8(c[2], last[1])));
}

static void compose_rgb(uint8_t *rgb, const uint8_t *luma, const int16_t *u,
                        const int16_t *v, size_t n, const int32_t m[3][4])
{
    size_t i = 0;

    for (; i + 8 <= n; i += 8) {
        const vi y = (vi)_mm256_cvtepu8_epi32(
            _mm_loadl_epi64((const __m128i *)(luma + i)));
        const vi a = (vi)_mm256_cvtepi16_epi32(
            _mm_loadu_si128((const __m128i *)(u + i)));
        const vi b = (vi)_mm256_cvtepi16_epi32(
            _mm_loadu_si128((const __m128i *)(v + i)));
        __m128i c[3];

        for (int j = 0; j < 3; j++)
            c[j] = compose_clamp_bytes((m[j][0] * y + m[j][1] * a +
                                        m[j][2] * b + m[j][3]) >> 16);
        compose_store_pixels(rgb + 3 * i, c);
    }
    compose_rgb_c(rgb + 3 * i, luma + i, u + i, v + i, n - i, m);
}
#else
static void compose_rgb(uint8_t *rgb, const uint8_t *luma, const int16_t *u,
                        const int16_t *v, size_t n, const int32_t m[3][4])
{
    compose_rgb_c(rgb, luma, u, v, n, m);
}

static void compose_planes(uint8_t *const plane[3], const uint8_t *rgb,
                           size_t n, const int32_t m[3][4])
{
    compose_planes_c(plane, rgb, n, m);
}
#endif

/* ---- halves -------------------------------------------------------------- */

#if defined(ISA_BASELINE)

/* on ? a : b, lanes of on being 0 or -1 */
static inline vi compose_choose(vi on, vi a, vi b)
{
    return (on & a) | (~on & b);
}

/* Numbers too small for half's exponent are rounded by adding 1/2, whose last
 * bit is their last. */
static void compose_half(uint16_t *out, const float *x, size_t n)
{
    typedef uint16_t vh __attribute__((vector_size(2 * LANES)));
    const vf half = {0.5f, 0.5f, 0.5f, 0.5f};
    size_t i = 0;

    for (; i + LANES <= n; i += LANES) {
        vi bits = (vi)compose_load(x + i), a = bits & 0x7fffffff;
        vi h = (a + 0xfff + (a >> 13 & 1) - 0x38000000) >> 13;

        h = compose_choose(a < 0x38800000, (vi)((vf)a + half) - (vi)half, h);
        h = compose_choose(a >= 0x477ff000, (vi){0} + 0x7c00, h);
        h = compose_choose(a > 0x7f800000, (vi){0} + 0x7e00, h);
        vh packed = __builtin_convertvector(h | (bits >> 16 & 0x8000), vh);

        memcpy(out + i, &packed, sizeof packed);
    }
    compose_half_c(out + i, x + i, n - i);
}

#else

static void compose_half(uint16_t *out, const float *x, size_t n)
{
    size_t i = 0;

    for (; i + 8 <= n; i += 8) {
        __m256 v = _mm256_loadu_ps(x + i);

        _mm_storeu_si128((__m128i *)(out + i),
                         _mm256_cvtps_ph(v, _MM_FROUND_TO_NEAREST_INT));
    }
    compose_half_c(out + i, x + i, n - i);
}

#endif

const struct compose_kernels ISA(compose_kernels) = {
    compose_blend, compose_quantise, compose_half, compose_planes, compose_rgb
};
