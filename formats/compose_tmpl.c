/* The inner loops of compose.h for AVX2 and up; tails go to the plain
 * versions. */
#include "formats/compose.h"

#if !defined(ISA_BASELINE)

#include <immintrin.h>
#include <string.h>

typedef __m256 v8f;
typedef int v8i __attribute__((vector_size(32)));
typedef uint8_t v8b __attribute__((vector_size(8)));

/* Eight floats, not aligned. */
static inline v8f v8_load(const float *p)
{
    v8f v;
    memcpy(&v, p, sizeof v);
    return v;
}

/* Eight bytes as floats. */
static inline v8f v8_load_bytes(const uint8_t *p)
{
    v8b v;
    memcpy(&v, p, sizeof v);
    return __builtin_convertvector(v, v8f);
}

/* x in levels, rounded and clamped; NaN becomes 0 (maxps keeps its second). */
static inline void v8_store_bytes(uint8_t *p, v8f x)
{
    v8f v = _mm256_max_ps(x + 0.5f, _mm256_setzero_ps());
    v = _mm256_min_ps(v, _mm256_set1_ps(255.0f));
    v8b b = __builtin_convertvector(__builtin_convertvector(v, v8i), v8b);
    memcpy(p, &b, sizeof b);
}

/* Eight pixels at a time: their alphas are spread over 24 values. */
void ISA(compose)(uint8_t *out, const float *color, const float *alpha,
                  const uint8_t *bg, size_t bg_step, size_t n)
{
    /* eight pixels are 24 values; value k belongs to pixel k / 3 */
    const v8i e0 = {0, 0, 0, 1, 1, 1, 2, 2};
    const v8i e1 = {2, 3, 3, 3, 4, 4, 4, 5};
    const v8i e2 = {5, 5, 6, 6, 6, 7, 7, 7};
    uint8_t fill[24];
    size_t i = 0;

    for (int k = 0; k < 24 && bg_step == 0; k++)
        fill[k] = bg[k % 3];
    for (; i + 8 <= n; i += 8) {
        const uint8_t *b = bg_step ? bg + 3 * i : fill;
        const float *c = color + 3 * i;
        v8f t = 1.0f - v8_load(alpha + i);
        v8_store_bytes(out + 3 * i, v8_load(c) * 255.0f
                       + __builtin_shuffle(t, e0) * v8_load_bytes(b));
        v8_store_bytes(out + 3 * i + 8, v8_load(c + 8) * 255.0f
                       + __builtin_shuffle(t, e1) * v8_load_bytes(b + 8));
        v8_store_bytes(out + 3 * i + 16, v8_load(c + 16) * 255.0f
                       + __builtin_shuffle(t, e2) * v8_load_bytes(b + 16));
    }
    compose_c(out + 3 * i, color + 3 * i, alpha + i, bg + bg_step * i,
              bg_step, n - i);
}

/* Eight values at a time. */
void ISA(compose_quantise)(uint8_t *out, const float *x, size_t n)
{
    size_t i = 0;

    for (; i + 8 <= n; i += 8)
        v8_store_bytes(out + i, v8_load(x + i) * 255.0f);
    compose_quantise_c(out + i, x + i, n - i);
}

/* By the processor's own conversion, to nearest even as in lib/base/half.h. */
void ISA(compose_half)(uint16_t *out, const float *x, size_t n)
{
    size_t i = 0;

    for (; i + 8 <= n; i += 8) {
        __m256 v = _mm256_loadu_ps(x + i);
        _mm_storeu_si128((__m128i *)(out + i),
                         _mm256_cvtps_ph(v, _MM_FROUND_TO_NEAREST_INT));
    }
    compose_half_c(out + i, x + i, n - i);
}

/* Exact. */
void ISA(compose_widen)(float *out, const uint16_t *x, size_t n)
{
    size_t i = 0;

    for (; i + 8 <= n; i += 8) {
        __m128i v = _mm_loadu_si128((const __m128i *)(x + i));
        _mm256_storeu_ps(out + i, _mm256_cvtph_ps(v));
    }
    compose_widen_c(out + i, x + i, n - i);
}

#endif
