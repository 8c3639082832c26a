/* Eight lanes (AVX2) or four: SSE2 where the compiler's own vectors have no
 * operation, and plain loops where there is neither.  Included by vec.h
 * only. */

typedef vi vm;                               /* lanes of 0 or -1 */

#define VM_ALL vi_set(-1)

/* X86(min_ps)(a, b) is the instruction of that name at this width. */
#if defined(ISA_AVX2)
#define X86(name) _mm256_##name
#define X86_F __m256
#define X86_I __m256i
#elif defined(__SSE2__)
#define X86(name) _mm_##name
#define X86_F __m128
#define X86_I __m128i
#endif

VEC_INLINE vf vf_fma(vf a, vf b, vf c)
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
#ifdef ISA_AVX2
    return (vf)_mm256_blendv_ps((__m256)b, (__m256)a, (__m256)m);
#else
    return (vf)((m & (vi)a) | (~m & (vi)b));
#endif
}

VEC_INLINE vf vf_keep(vm m, vf a)            /* m ? a : 0 */
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
#ifdef X86
    return (vf)X86(min_ps)((X86_F)a, (X86_F)b);
#else
    return vf_sel(a < b, a, b);
#endif
}

VEC_INLINE vf vf_max(vf a, vf b)
{
#ifdef X86
    return (vf)X86(max_ps)((X86_F)a, (X86_F)b);
#else
    return vf_sel(a > b, a, b);
#endif
}

VEC_INLINE vf vf_sqrt(vf a)
{
#ifdef X86
    return (vf)X86(sqrt_ps)((X86_F)a);
#else
    for (int i = 0; i < VEC; i++)
        a[i] = __builtin_sqrtf(a[i]);
    return a;
#endif
}

VEC_INLINE vm vm_and(vm a, vm b)
{
    return a & b;
}

VEC_INLINE vm vm_not(vm a)
{
    return ~a;
}

/* m ? a b : 0, b finite: where b is waited for, a is masked meanwhile */
VEC_INLINE vf vf_mul_keep(vm m, vf a, vf b)
{
    return vf_keep(m, a) * b;
}

/* x times 1 + 2^-9 at most, 0 or more, at least sqrt(a); a >= 1e-30 */
VEC_INLINE vf vf_sqrt_above(vf a)
{
#ifdef X86
    return a * (vf)X86(rsqrt_ps)((X86_F)a) * vf_set(1 + 0x1p-11f);
#else
    return vf_sqrt(a) * vf_set(1 + 0x1p-13f);
#endif
}

/* Of numbers of one sign, not negative. */
VEC_INLINE vf vf_min_positive(vf a, vf b)
{
    return vf_min(a, b);
}

VEC_INLINE vf vf_fma_keep(vm m, vf a, vf b, vf c)   /* m ? a b + c : c */
{
    return vf_fma(vf_keep(m, a), b, c);
}

VEC_INLINE vf vf_fnma_keep(vm m, vf a, vf b, vf c)  /* m ? c - a b : 0 */
{
    return vf_keep(m, vf_fnma(a, b, c));
}

VEC_INLINE uint32_t vm_bits(vm m)
{
#ifdef X86
    return (uint32_t)X86(movemask_ps)((X86_F)m);
#else
    uint32_t bits = 0;

    for (int i = 0; i < VEC; i++)
        bits |= (uint32_t)(m[i] & 1) << i;
    return bits;
#endif
}

VEC_INLINE vm vm_from_bits(uint32_t bits)
{
    static const int32_t lane[] = {1, 2, 4, 8, 16, 32, 64, 128};
    vi own = vi_load(lane);

    return (vi_set((int32_t)bits) & own) == own;
}

VEC_INLINE int vm_any(vm a)
{
    return vm_bits(a) != 0;
}

VEC_INLINE vi vf_round(vf a)                 /* to nearest integer */
{
#ifdef X86
    return (vi)X86(cvtps_epi32)((X86_F)a);
#else
    for (int i = 0; i < VEC; i++)
        a[i] = __builtin_rintf(a[i]);
    return __builtin_convertvector(a, vi);
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

static const uint64_t vec_lists[] __attribute__((unused)) = {
    LIST16(0),
#if VEC == 8
    LIST16(16), LIST16(32), LIST16(48), LIST16(64), LIST16(80), LIST16(96),
    LIST16(112), LIST16(128), LIST16(144), LIST16(160), LIST16(176),
    LIST16(192), LIST16(208), LIST16(224), LIST16(240)
#endif
};

/* at + the number of each lane in m to p, in order; returns how many.  VEC are
 * written. */
VEC_INLINE uint32_t vm_list(uint32_t *p, vm m, uint32_t at)
{
    uint32_t bits = vm_bits(m);
#if defined(ISA_AVX2)
    __m128i bytes = _mm_loadl_epi64((const __m128i *)&vec_lists[bits]);
    vi number = (vi)_mm256_cvtepu8_epi32(bytes);
#elif defined(__SSE2__)
    __m128i zero = _mm_setzero_si128();
    __m128i bytes = _mm_loadl_epi64((const __m128i *)&vec_lists[bits]);
    vi number = (vi)_mm_unpacklo_epi16(_mm_unpacklo_epi8(bytes, zero), zero);
#else
    vi number;

    for (int k = 0; k < VEC; k++)
        number[k] = (int32_t)(vec_lists[bits] >> 8 * k & 255);
#endif
    vi_store(p, number + vi_set((int32_t)at));
#if VEC == 8
    return (uint32_t)__builtin_popcount(bits);
#else
    return (uint32_t)(0x4332322132212110 >> 4 * bits) & 15;
#endif
}

/* Four floats, as often as they fit. */
VEC_INLINE vf vf_repeat(const float *p)
{
#ifdef ISA_AVX2
    return (vf)_mm256_broadcast_ps((const __m128 *)p);
#else
    return vf_load(p);
#endif
}

/* from[at[0]], from[at[1]] ... */
VEC_INLINE vf vf_gather(const float *from, vi at)
{
    vf v;

    for (int k = 0; k < VEC; k++)
        v[k] = from[at[k]];
    return v;
}
