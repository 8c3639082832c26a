/* Sixteen lanes for the rasteriser's kernels: AVX-512 by intrinsics, any other
 * instruction set by the compiler's vectors.  A mask is vm; its bit or lane i
 * belongs to lane i. */
#ifndef SPID_SPLAT_VEC_H
#define SPID_SPLAT_VEC_H

#include <stdint.h>
#include <string.h>

#if defined(ISA_AVX512) || defined(ISA_AVX2)
#include <immintrin.h>
#endif

#pragma GCC diagnostic ignored "-Wpsabi"

#define VEC 16
#define VEC_INLINE static inline __attribute__((always_inline, unused))

typedef float vf __attribute__((vector_size(64), may_alias));
typedef int32_t vi __attribute__((vector_size(64), may_alias));
typedef uint32_t vu __attribute__((vector_size(64), may_alias));

VEC_INLINE vf vf_set(float x)
{
    return (vf){x, x, x, x, x, x, x, x, x, x, x, x, x, x, x, x};
}

VEC_INLINE vi vi_set(int32_t x)
{
    return (vi){x, x, x, x, x, x, x, x, x, x, x, x, x, x, x, x};
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

/* Four floats, four times. */
VEC_INLINE vf vf_repeat(const float *p)
{
#ifdef ISA_AVX512
    return (vf)_mm512_broadcast_f32x4(_mm_loadu_ps(p));
#else
    return (vf){p[0], p[1], p[2], p[3], p[0], p[1], p[2], p[3],
                p[0], p[1], p[2], p[3], p[0], p[1], p[2], p[3]};
#endif
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

VEC_INLINE void vf_store(float *p, vf v)
{
    memcpy(p, &v, sizeof v);
}

VEC_INLINE void vi_store(void *p, vi v)
{
    memcpy(p, &v, sizeof v);
}

VEC_INLINE vi vi_iota(void)
{
    return (vi){0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
}

#ifdef ISA_AVX512

typedef __mmask16 vm;

#define VM_ALL ((vm)0xffff)

VEC_INLINE vf vf_fma(vf a, vf b, vf c)
{
    return (vf)_mm512_fmadd_ps((__m512)a, (__m512)b, (__m512)c);
}

VEC_INLINE vf vf_fnma(vf a, vf b, vf c)      /* c - a b */
{
    return (vf)_mm512_fnmadd_ps((__m512)a, (__m512)b, (__m512)c);
}

VEC_INLINE vf vf_min(vf a, vf b)
{
    return (vf)_mm512_min_ps((__m512)a, (__m512)b);
}

VEC_INLINE vf vf_max(vf a, vf b)
{
    return (vf)_mm512_max_ps((__m512)a, (__m512)b);
}

VEC_INLINE vf vf_sqrt(vf a)
{
    return (vf)_mm512_sqrt_ps((__m512)a);
}

VEC_INLINE vm vf_gt(vf a, vf b)
{
    return _mm512_cmp_ps_mask((__m512)a, (__m512)b, _CMP_GT_OQ);
}

VEC_INLINE vm vf_ge(vf a, vf b)
{
    return _mm512_cmp_ps_mask((__m512)a, (__m512)b, _CMP_GE_OQ);
}

VEC_INLINE vm vf_gt_and(vm m, vf a, vf b)
{
    return _mm512_mask_cmp_ps_mask(m, (__m512)a, (__m512)b, _CMP_GT_OQ);
}

VEC_INLINE vm vm_and(vm a, vm b)
{
    return (vm)(a & b);
}

VEC_INLINE vm vm_not(vm a)
{
    return (vm)~a;
}

VEC_INLINE vf vf_sel(vm m, vf a, vf b)       /* m ? a : b */
{
    return (vf)_mm512_mask_mov_ps((__m512)b, m, (__m512)a);
}

VEC_INLINE vf vf_keep(vm m, vf a)            /* m ? a : 0 */
{
    return (vf)_mm512_maskz_mov_ps(m, (__m512)a);
}

VEC_INLINE vf vf_mul_keep(vm m, vf a, vf b)  /* m ? a b : 0 */
{
    return (vf)_mm512_maskz_mul_ps(m, (__m512)a, (__m512)b);
}

/* x times 1 + 2^-14 at most, 0 or more, at least sqrt(a); a >= 1e-30 */
VEC_INLINE vf vf_sqrt_above(vf a)
{
    return a * (vf)_mm512_rsqrt14_ps((__m512)a) * vf_set(1 + 0x1p-13f);
}

/* Of numbers of one sign, not negative: compared as integers, which more of
 * the processor's units can do. */
VEC_INLINE vf vf_min_positive(vf a, vf b)
{
    return (vf)_mm512_min_epi32((__m512i)a, (__m512i)b);
}

VEC_INLINE vf vf_fma_keep(vm m, vf a, vf b, vf c)   /* m ? a b + c : c */
{
    return (vf)_mm512_mask3_fmadd_ps((__m512)a, (__m512)b, (__m512)c, m);
}

VEC_INLINE vf vf_fnma_keep(vm m, vf a, vf b, vf c)  /* m ? c - a b : 0 */
{
    return (vf)_mm512_maskz_fnmadd_ps(m, (__m512)a, (__m512)b, (__m512)c);
}

VEC_INLINE uint32_t vm_bits(vm m)
{
    return m;
}

VEC_INLINE vm vm_from_bits(uint32_t bits)
{
    return (vm)bits;
}

VEC_INLINE int vm_any(vm a)
{
    return !_kortestz_mask16_u8(a, a);
}

VEC_INLINE vi vf_round(vf a)                 /* to nearest integer */
{
    return (vi)_mm512_cvtps_epi32((__m512)a);
}

/* Lanes of v picked by m to p, in order; returns how many.  16 are written. */
VEC_INLINE uint32_t vi_compress(void *p, vm m, vi v)
{
    _mm512_storeu_si512(p, _mm512_maskz_compress_epi32(m, (__m512i)v));
    return (uint32_t)__builtin_popcount(m);
}

/* r[i] lane j <-> r[j] lane i */
VEC_INLINE void vf_transpose(vf r[16])
{
    __m512 t[16];

    for (int i = 0; i < 16; i += 2) {
        t[i] = _mm512_unpacklo_ps((__m512)r[i], (__m512)r[i + 1]);
        t[i + 1] = _mm512_unpackhi_ps((__m512)r[i], (__m512)r[i + 1]);
    }
    __m512 u[16];

    for (int i = 0; i < 16; i += 4) {
        u[i] = _mm512_shuffle_ps(t[i], t[i + 2], 0x44);
        u[i + 1] = _mm512_shuffle_ps(t[i], t[i + 2], 0xee);
        u[i + 2] = _mm512_shuffle_ps(t[i + 1], t[i + 3], 0x44);
        u[i + 3] = _mm512_shuffle_ps(t[i + 1], t[i + 3], 0xee);
    }
    for (int i = 0; i < 4; i++) {
        t[i] = _mm512_shuffle_f32x4(u[i], u[i + 4], 0x88);
        t[i + 4] = _mm512_shuffle_f32x4(u[i], u[i + 4], 0xdd);
        t[i + 8] = _mm512_shuffle_f32x4(u[i + 8], u[i + 12], 0x88);
        t[i + 12] = _mm512_shuffle_f32x4(u[i + 8], u[i + 12], 0xdd);
    }
    for (int i = 0; i < 4; i++) {
        r[i] = (vf)_mm512_shuffle_f32x4(t[i], t[i + 8], 0x88);
        r[i + 4] = (vf)_mm512_shuffle_f32x4(t[i + 4], t[i + 12], 0x88);
        r[i + 8] = (vf)_mm512_shuffle_f32x4(t[i], t[i + 8], 0xdd);
        r[i + 12] = (vf)_mm512_shuffle_f32x4(t[i + 4], t[i + 12], 0xdd);
    }
}

#else

typedef vi vm;

#define VM_ALL vi_set(-1)

VEC_INLINE vf vf_fma(vf a, vf b, vf c)
{
    return a * b + c;
}

VEC_INLINE vf vf_fnma(vf a, vf b, vf c)
{
    return c - a * b;
}

VEC_INLINE vf vf_sel(vm m, vf a, vf b)
{
    return (vf)((m & (vi)a) | (~m & (vi)b));
}

VEC_INLINE vf vf_keep(vm m, vf a)
{
    return (vf)(m & (vi)a);
}

VEC_INLINE vm vf_gt(vf a, vf b)
{
    return a > b;
}

VEC_INLINE vm vf_ge(vf a, vf b)
{
    return a >= b;
}

VEC_INLINE vm vf_gt_and(vm m, vf a, vf b)
{
    return m & (a > b);
}

VEC_INLINE vf vf_min(vf a, vf b)
{
    return vf_sel(a < b, a, b);
}

VEC_INLINE vf vf_max(vf a, vf b)
{
    return vf_sel(a > b, a, b);
}

VEC_INLINE vf vf_sqrt(vf a)
{
    for (int i = 0; i < VEC; i++)
        a[i] = __builtin_sqrtf(a[i]);
    return a;
}

VEC_INLINE vm vm_and(vm a, vm b)
{
    return a & b;
}

VEC_INLINE vm vm_not(vm a)
{
    return ~a;
}

VEC_INLINE vf vf_mul_keep(vm m, vf a, vf b)
{
    return vf_keep(m, a * b);
}

VEC_INLINE vf vf_sqrt_above(vf a)
{
    return vf_sqrt(a) * vf_set(1 + 0x1p-13f);
}

VEC_INLINE vf vf_min_positive(vf a, vf b)
{
    return vf_min(a, b);
}

VEC_INLINE vf vf_fma_keep(vm m, vf a, vf b, vf c)
{
    return vf_keep(m, a) * b + c;
}

VEC_INLINE vf vf_fnma_keep(vm m, vf a, vf b, vf c)
{
    return vf_keep(m, c - a * b);
}

VEC_INLINE uint32_t vm_bits(vm m)
{
    uint32_t bits = 0;

    for (int i = 0; i < VEC; i++)
        bits |= (uint32_t)(m[i] & 1) << i;
    return bits;
}

VEC_INLINE vm vm_from_bits(uint32_t bits)
{
    return -((vi_set((int32_t)bits) >> vi_iota()) & 1);
}

VEC_INLINE int vm_any(vm a)
{
    return vm_bits(a) != 0;
}

VEC_INLINE vi vf_round(vf a)
{
    for (int i = 0; i < VEC; i++)
        a[i] = __builtin_rintf(a[i]);
    return __builtin_convertvector(a, vi);
}

VEC_INLINE uint32_t vi_compress(void *p, vm m, vi v)
{
    int32_t *out = p;
    uint32_t n = 0;

    for (int i = 0; i < VEC; i++) {
        out[n] = v[i];
        n += (uint32_t)(m[i] & 1);
    }
    return n;
}

VEC_INLINE void vf_transpose(vf r[16])
{
    float t[16][16];

    for (int i = 0; i < 16; i++)
        for (int j = 0; j < 16; j++)
            t[j][i] = r[i][j];
    memcpy(r, t, sizeof t);
}

#endif

/* Four by four: r[i] float 4k + j <-> r[j] float 4k + i, for each k. */
VEC_INLINE void vf_transpose_quads(vf r[4])
{
#ifdef ISA_AVX512
    __m512 a = _mm512_unpacklo_ps((__m512)r[0], (__m512)r[1]);
    __m512 b = _mm512_unpackhi_ps((__m512)r[0], (__m512)r[1]);
    __m512 c = _mm512_unpacklo_ps((__m512)r[2], (__m512)r[3]);
    __m512 d = _mm512_unpackhi_ps((__m512)r[2], (__m512)r[3]);

    r[0] = (vf)_mm512_shuffle_ps(a, c, 0x44);
    r[1] = (vf)_mm512_shuffle_ps(a, c, 0xee);
    r[2] = (vf)_mm512_shuffle_ps(b, d, 0x44);
    r[3] = (vf)_mm512_shuffle_ps(b, d, 0xee);
#else
    float t[4][VEC], u[4][VEC];

    memcpy(t, r, sizeof t);
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            for (int k = 0; k < VEC; k += 4)
                u[j][k + i] = t[i][k + j];
    memcpy(r, u, sizeof u);
#endif
}

/* Four by four in quads of floats: r[i] quad j <-> r[j] quad i. */
VEC_INLINE void vf_swap_quads(vf r[4])
{
#ifdef ISA_AVX512
    __m512 a = _mm512_shuffle_f32x4((__m512)r[0], (__m512)r[1], 0x44);
    __m512 b = _mm512_shuffle_f32x4((__m512)r[0], (__m512)r[1], 0xee);
    __m512 c = _mm512_shuffle_f32x4((__m512)r[2], (__m512)r[3], 0x44);
    __m512 d = _mm512_shuffle_f32x4((__m512)r[2], (__m512)r[3], 0xee);

    r[0] = (vf)_mm512_shuffle_f32x4(a, c, 0x88);
    r[1] = (vf)_mm512_shuffle_f32x4(a, c, 0xdd);
    r[2] = (vf)_mm512_shuffle_f32x4(b, d, 0x88);
    r[3] = (vf)_mm512_shuffle_f32x4(b, d, 0xdd);
#else
    float t[4][VEC], u[4][VEC];

    memcpy(t, r, sizeof t);
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            memcpy(u[j] + 4 * i, t[i] + 4 * j, 16);
    memcpy(r, u, sizeof u);
#endif
}

/* Rows of `width` numbers, up to four, from as many vectors: number k of row n
 * is lane n of v[k]. */
VEC_INLINE void vf_interleave(vf v[4], const size_t width)
{
#ifdef ISA_AVX512
    /* of three: number k of the result is of the first, the second (16 and
     * on), or where blue has a bit of the third */
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

    if (width == 3) {
        __m512 r = (__m512)v[0], g = (__m512)v[1], b = (__m512)v[2];

        for (int j = 0; j < 3; j++)
            v[j] = (vf)_mm512_mask_permutexvar_ps(
                _mm512_permutex2var_ps(r, two[j], g), blue[j], third[j], b);
        return;
    }
    if (width == 4) {
        vf_transpose_quads(v);
        vf_swap_quads(v);
        return;
    }
#endif
    float flat[4 * VEC];

    for (size_t k = 0; k < width; k++)
        for (size_t n = 0; n < VEC; n++)
            flat[n * width + k] = v[k][n];
    for (size_t k = 0; k < width; k++)
        v[k] = vf_load(flat + VEC * k);
}

VEC_INLINE vf vf_abs(vf a)
{
    return (vf)((vi)a & 0x7fffffff);
}

VEC_INLINE vf vf_clamp(vf a, vf lo, vf hi)
{
    return vf_min(vf_max(a, lo), hi);
}

/* Four times four floats side by side. */
VEC_INLINE vf vf_join(const float *a, const float *b, const float *c,
                      const float *d)
{
    vf v;
#ifdef ISA_AVX512
    __m512 x = _mm512_castps128_ps512(_mm_loadu_ps(a));

    x = _mm512_insertf32x4(x, _mm_loadu_ps(b), 1);
    x = _mm512_insertf32x4(x, _mm_loadu_ps(c), 2);
    v = (vf)_mm512_insertf32x4(x, _mm_loadu_ps(d), 3);
#else
    memcpy(&v, a, 16);
    memcpy((char *)&v + 16, b, 16);
    memcpy((char *)&v + 32, c, 16);
    memcpy((char *)&v + 48, d, 16);
#endif
    return v;
}

/* Sum of the lanes, always in the same order. */
VEC_INLINE float vf_sum(vf a)
{
    float s[16];

    vf_store(s, a);
    for (int w = 8; w; w /= 2)
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
 * all of the first's. */
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
