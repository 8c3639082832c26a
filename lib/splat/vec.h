/* Lanes for the rasteriser's kernels: one vector is one register, of sixteen
 * floats (AVX-512), eight (AVX2) or four (SSE2, NEON and whatever else GCC's
 * vectors cover).  A wider vector than the registers would be taken apart
 * through memory.  Types and what every width shares; vec_avx512.inc and
 * vec_any.inc have the operations, vec_shuffle.h moves numbers between lanes.
 *
 * vf, vi, vu are floats, ints and unsigned ints; C's operators work on them.
 * vm is a mask; its bit or lane i belongs to lane i. */
#ifndef SPID_SPLAT_VEC_H
#define SPID_SPLAT_VEC_H

#include <stdint.h>
#include <string.h>

#if defined(__x86_64__)
#include <immintrin.h>
#elif defined(__ARM_NEON)
#include <arm_neon.h>
#endif

#pragma GCC diagnostic ignored "-Wpsabi"

#if defined(ISA_AVX512)
#define VEC 16
#define VEC_ALL(x) x, x, x, x, x, x, x, x, x, x, x, x, x, x, x, x
#define VEC_IOTA 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15
#elif defined(ISA_AVX2)
#define VEC 8
#define VEC_ALL(x) x, x, x, x, x, x, x, x
#define VEC_IOTA 0, 1, 2, 3, 4, 5, 6, 7
#else
#define VEC 4
#define VEC_ALL(x) x, x, x, x
#define VEC_IOTA 0, 1, 2, 3
#endif

#define VEC_QUADS (VEC / 4)
#define VEC_INLINE static inline __attribute__((always_inline, unused))

typedef float vf __attribute__((vector_size(4 * VEC), may_alias));
typedef int32_t vi __attribute__((vector_size(4 * VEC), may_alias));
typedef uint32_t vu __attribute__((vector_size(4 * VEC), may_alias));
typedef float vq __attribute__((vector_size(16), may_alias));  /* a quad */

VEC_INLINE vf vf_set(float x)
{
    return (vf){VEC_ALL(x)};
}

VEC_INLINE vi vi_set(int32_t x)
{
    return (vi){VEC_ALL(x)};
}

VEC_INLINE vf vf_load(const float *p)
{
    vf v;

    memcpy(&v, p, sizeof v);
    return v;
}

VEC_INLINE vi vi_load(const void *p)
{
    vi v;

    memcpy(&v, p, sizeof v);
    return v;
}

VEC_INLINE vq vq_load(const float *p)
{
    vq v;

    memcpy(&v, p, sizeof v);
    return v;
}

VEC_INLINE void vf_store(float *p, vf v)
{
    memcpy(p, &v, sizeof v);
}

VEC_INLINE void vi_store(void *p, vi v)
{
    memcpy(p, &v, sizeof v);
}

VEC_INLINE void vq_store(float *p, vq v)
{
    memcpy(p, &v, sizeof v);
}

VEC_INLINE vi vi_iota(void)
{
    return (vi){VEC_IOTA};
}

#if defined(ISA_AVX512)
#include "lib/splat/vec_avx512.inc"
#else
#include "lib/splat/vec_any.inc"
#endif

VEC_INLINE vf vf_abs(vf a)
{
    return (vf)((vi)a & 0x7fffffff);
}

VEC_INLINE vf vf_clamp(vf a, vf lo, vf hi)
{
    return vf_min(vf_max(a, lo), hi);
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

/* Coefficients of 2^f on [-1/2, 1/2], by degree, fitted for the smallest
 * relative error: 2: 1.7e-3, 3: 7.5e-5, 4: 2.6e-6, 5: 7.5e-8 (float's own
 * rounding). */
static const float exp2_table[6][6] = {
    [2] = {1.00044314f, 0.703448041f, 0.238428941f},
    [3] = {0.999928073f, 0.693260986f, 0.242611128f, 0.0551716698f},
    [4] = {0.999999261f, 0.693121815f, 0.240247448f, 0.0559178612f,
           0.00957010199f},
    [5] = {1.00000007f, 0.693146967f, 0.240221197f, 0.0555071327f,
           0.00967554143f, 0.00132764721f}};

#ifdef ISA_AVX512
/* Four values take each step side by side: the processor looks only a few
 * dozen instructions ahead, too few to find the second value's steps behind
 * all of the first's.  With sixteen registers there is no room for it. */
#define ABREAST(v) \
    __asm__ volatile("" : "+v"((v)[0]), "+v"((v)[1]), "+v"((v)[2]), \
                     "+v"((v)[3]))
/* What has been stored is loaded, part by part: the compiler would rather take
 * the vectors apart by shuffles, of which the processor does one a cycle. */
#define FROM_MEMORY(v) __asm__ volatile("" : "+m"(v))
#else
#define ABREAST(v) (void)(v)
#define FROM_MEMORY(v) (void)(v)
#endif

/* q[k] becomes 2^q[k], for q in about [-100, 0]. */
VEC_INLINE void vf_exp2_four(vf q[4], const int degree)
{
    const float *c = exp2_table[degree];
    const float magic = 12582912.0f;         /* 1.5 * 2^23: rounds */
    vf t[4], f[4], p[4];

#define FOUR _Pragma("GCC unroll 4") for (int k = 0; k < 4; k++)
    FOUR t[k] = q[k] + magic;
    ABREAST(t);
    FOUR f[k] = t[k] - magic;
    ABREAST(f);
    FOUR f[k] = q[k] - f[k];
    ABREAST(f);
    FOUR p[k] = vf_fma(vf_set(c[degree]), f[k], vf_set(c[degree - 1]));
    ABREAST(p);
    FOUR t[k] = (vf)((vu)t[k] << 23);    /* unsigned: drops bits */
    ABREAST(t);
#pragma GCC unroll 4
    for (int d = degree - 2; d >= 0; d--) {
        FOUR p[k] = vf_fma(p[k], f[k], vf_set(c[d]));
        ABREAST(p);
    }
    FOUR q[k] = (vf)((vu)p[k] + (vu)t[k]);
}

#endif
