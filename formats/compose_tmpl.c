/* Rendered colours to bytes, floats to half precision and back: a vector of
 * numbers at a time, as wide as the instruction set's registers for it. */
#include "formats/compose.h"

#include "lib/base/simd.h"

/* What belongs to the values of vector k of three: value i is of pixel i / 3.
 * k is a constant. */
static inline vf compose_spread(vf t, size_t k)
{
#if VEC == 4
    return k == 0   ? __builtin_shufflevector(t, t, 0, 0, 0, 1)
           : k == 1 ? __builtin_shufflevector(t, t, 1, 1, 2, 2)
                    : __builtin_shufflevector(t, t, 2, 3, 3, 3);
#elif VEC == 8
    return k == 0   ? __builtin_shufflevector(t, t, 0, 0, 0, 1, 1, 1, 2, 2)
           : k == 1 ? __builtin_shufflevector(t, t, 2, 3, 3, 3, 4, 4, 4, 5)
                    : __builtin_shufflevector(t, t, 5, 5, 6, 6, 6, 7, 7, 7);
#else
    return k == 0   ? __builtin_shufflevector(t, t, 0, 0, 0, 1, 1, 1, 2, 2,
                                              2, 3, 3, 3, 4, 4, 4, 5)
           : k == 1 ? __builtin_shufflevector(t, t, 5, 5, 6, 6, 6, 7, 7, 7,
                                              8, 8, 8, 9, 9, 9, 10, 10)
                    : __builtin_shufflevector(t, t, 10, 11, 11, 11, 12, 12,
                                              12, 13, 13, 13, 14, 14, 14, 15,
                                              15, 15);
#endif
}

static void compose_blend(uint8_t *out, const float *color,
                          const float *alpha, const uint8_t *bg,
                          size_t bg_step, size_t n)
{
    uint8_t fill[3 * VEC];
    size_t i = 0;

    for (int k = 0; k < 3 * VEC && bg_step == 0; k++)
        fill[k] = bg[k % 3];
    for (; i + VEC <= n; i += VEC) {
        const uint8_t *b = bg_step ? bg + 3 * i : fill;

        vf t = 1 - vf_load(alpha + i);

#pragma GCC unroll 3
        for (size_t k = 0; k < 3; k++)
            vf_store_bytes(out + 3 * i + VEC * k,
                           255 * vf_load(color + 3 * i + VEC * k) +
                           compose_spread(t, k) * vf_load_bytes(b + VEC * k) +
                           0.5f);
    }
    compose_c(out + 3 * i, color + 3 * i, alpha + i, bg + bg_step * i,
              bg_step, n - i);
}

static void compose_quantise(uint8_t *out, const float *x, size_t n)
{
    size_t i = 0;

    for (; i + VEC <= n; i += VEC)
        vf_store_bytes(out + i, vf_load(x + i) * 255 + 0.5f);
    compose_quantise_c(out + i, x + i, n - i);
}

/* ---- planes -------------------------------------------------------------- */

#if VEC > 4
typedef VEC_TYPE(int32_t, 8) eight;
typedef VEC_TYPE(uint8_t, 16) bytes16;

/* Of eight pixels' 24 bytes, 16 in a and the rest in b, every third from k. */
#define CHANNEL(a, b, k)                                                     \
    ((eight)_mm256_cvtepu8_epi32((__m128i)__builtin_shufflevector(           \
        a, b, k, k + 3, k + 6, k + 9, k + 12, k + 15, k + 18, k + 21,        \
        k, k, k, k, k, k, k, k)))

/* Eight numbers as bytes, clamped. */
static inline bytes16 compose_clamp_bytes(eight v)
{
    const __m128i h = _mm_packs_epi32(_mm256_castsi256_si128((__m256i)v),
                                      _mm256_extracti128_si256((__m256i)v, 1));

    return (bytes16)_mm_packus_epi16(h, h);
}

static void compose_planes(uint8_t *const plane[3], const uint8_t *rgb,
                           size_t n, const int32_t m[3][4])
{
    size_t i = 0;

    for (; i + 8 <= n; i += 8) {
        const uint8_t *p = rgb + 3 * i;
        const bytes16 a = (bytes16)_mm_loadu_si128((const __m128i *)p);
        const bytes16 b = (bytes16)_mm_loadl_epi64((const __m128i *)(p + 16));
        const eight red = CHANNEL(a, b, 0), green = CHANNEL(a, b, 1);
        const eight blue = CHANNEL(a, b, 2);

        for (int j = 0; j < 3; j++) {
            const bytes16 level = compose_clamp_bytes(
                (m[j][0] * red + m[j][1] * green + m[j][2] * blue + m[j][3]) >>
                16);

            memcpy(plane[j] + i, &level, 8);
        }
    }
    compose_planes_c((uint8_t *[3]){plane[0] + i, plane[1] + i, plane[2] + i},
                     rgb + 3 * i, n - i, m);
}

/* Eight pixels from their channels' bytes: the first sixteen bytes, and the
 * last eight. */
static inline void compose_store_pixels(uint8_t *rgb, const bytes16 c[3])
{
    const bytes16 rg = (bytes16)_mm_unpacklo_epi8((__m128i)c[0],
                                                  (__m128i)c[1]);
    const bytes16 first = __builtin_shufflevector(
        rg, c[2], 0, 1, 16, 2, 3, 17, 4, 5, 18, 6, 7, 19, 8, 9, 20, 10);
    const bytes16 last = __builtin_shufflevector(
        rg, c[2], 11, 21, 12, 13, 22, 14, 15, 23, 0, 0, 0, 0, 0, 0, 0, 0);

    memcpy(rgb, &first, 16);
    memcpy(rgb + 16, &last, 8);
}

static void compose_rgb(uint8_t *rgb, const uint8_t *luma, const int16_t *u,
                        const int16_t *v, size_t n, const int32_t m[3][4])
{
    size_t i = 0;

    for (; i + 8 <= n; i += 8) {
        const eight y = (eight)_mm256_cvtepu8_epi32(
            _mm_loadl_epi64((const __m128i *)(luma + i)));
        const eight a = (eight)_mm256_cvtepi16_epi32(
            _mm_loadu_si128((const __m128i *)(u + i)));
        const eight b = (eight)_mm256_cvtepi16_epi32(
            _mm_loadu_si128((const __m128i *)(v + i)));
        bytes16 c[3];

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

static void compose_half(uint16_t *out, const float *x, size_t n)
{
    size_t i = 0;

    for (; i + VEC <= n; i += VEC)
        vf_store_half(out + i, vf_load(x + i));
    compose_half_c(out + i, x + i, n - i);
}

const struct compose_kernels ISA(compose_kernels) = {
    compose_blend, compose_quantise, compose_half, compose_planes, compose_rgb
};
