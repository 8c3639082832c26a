/* Sixteen lanes: AVX-512.  Included by vec.h only, as vec_any.h is for the
 * others; the comments are here. */

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

/* at + the number of each lane in m to p, in order; returns how many.  VEC are
 * written. */
VEC_INLINE uint32_t vm_list(uint32_t *p, vm m, uint32_t at)
{
    vi number = vi_iota() + vi_set((int32_t)at);

    _mm512_storeu_si512(p, _mm512_maskz_compress_epi32(m, (__m512i)number));
    return (uint32_t)__builtin_popcount(m);
}

/* Four floats, as often as they fit. */
VEC_INLINE vf vf_repeat(const float *p)
{
    return (vf)_mm512_broadcast_f32x4(_mm_loadu_ps(p));
}

/* from[at[0]], from[at[1]] ... */
VEC_INLINE vf vf_gather(const float *from, vi at)
{
    return (vf)_mm512_i32gather_ps((__m512i)at, from, 4);
}
