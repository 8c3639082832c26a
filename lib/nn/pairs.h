/* Products of matrices in bfloat16 with sums in float.  Two neighbours along
 * the summed dimension lie in one 32-bit word, the first in its lower half,
 * as the processor's instruction for it wants them; 12 rows by 32 columns of
 * the result stay in registers.  Private to the kernels of lib/nn. */
#ifndef SPID_NN_PAIRS_H
#define SPID_NN_PAIRS_H

#include <stdbool.h>

#include "lib/nn/pairs_size.h"
#include "lib/nn/vector.h"

/* vectors of a row of the block */
#define PAIRS_WIDE (2 * PAIRS_PANEL / VEC)

/* acc + a0 b0 + a1 b1 in each lane; a, b: pairs of bfloat16. */
VEC_INLINE vf pairs_dot(vf acc, vu a, vu b)
{
#if defined(ISA_AVX512)
    return (vf)_mm512_dpbf16_ps((__m512)acc, (__m512bh)a, (__m512bh)b);
#else
    acc += (vf)(a << 16) * (vf)(b << 16);
    return acc + (vf)(a & 0xffff0000) * (vf)(b & 0xffff0000);
#endif
}

/* Pairs of a (lower half) and b, rounded to nearest even. */
VEC_INLINE vu pairs_round(vf a, vf b)
{
#if defined(ISA_AVX512)
    const __m512i order = _mm512_set_epi16(
        31, 15, 30, 14, 29, 13, 28, 12, 27, 11, 26, 10, 25, 9, 24, 8, 23, 7,
        22, 6, 21, 5, 20, 4, 19, 3, 18, 2, 17, 1, 16, 0);
    __m512bh both = _mm512_cvtne2ps_pbh((__m512)b, (__m512)a);

    return (vu)_mm512_permutexvar_epi16(order, (__m512i)both);
#else
    vu u = (vu)a, v = (vu)b;

    u = u + 0x7fff + ((u >> 16) & 1);
    v = v + 0x7fff + ((v >> 16) & 1);
    return u >> 16 | (v & 0xffff0000);
#endif
}

/* to (16) = pairs of the n <= 16 values of a and b, then pairs of zeros. */
VEC_INLINE void pairs_round_rows(uint32_t *to, const float *a,
                                 const float *b, size_t n)
{
    for (size_t i = 0; i < PAIRS_PANEL; i += VEC) {
        size_t left = n < i ? 0 : n - i < VEC ? n - i : VEC;

        vi_store(to + i, (vi)pairs_round(vf_load_some(a + i, left),
                                         vf_load_some(b + i, left)));
    }
}

/* n <= VEC halves from p, each in a word, zeros after them. */
VEC_INLINE vu pairs_load_halves(const uint16_t *p, size_t n)
{
#if defined(ISA_AVX512)
    return (vu)_mm512_cvtepu16_epi32(
        _mm256_maskz_loadu_epi16((__mmask16)((1u << n) - 1), p));
#else
    uint32_t lane[VEC] = { 0 };

    for (size_t i = 0; i < n; i++)
        lane[i] = p[i];
    return (vu)vi_load(lane);
#endif
}

/* to (16) = pairs of the n <= 16 halves of a and b, then pairs of zeros. */
VEC_INLINE void pairs_join_rows(uint32_t *to, const uint16_t *a,
                                const uint16_t *b, size_t n)
{
    for (size_t i = 0; i < PAIRS_PANEL; i += VEC) {
        size_t left = n < i ? 0 : n - i < VEC ? n - i : VEC;

        vi_store(to + i, (vi)(pairs_load_halves(a + i, left) |
                              pairs_load_halves(b + i, left) << 16));
    }
}

/* C (rows <= 12, n <= 32 columns, ld apart) = A B over K pairs, or += with
 * add: element (r,k) of A at A[r rs + k ks], B in `wide` vectors of one or two
 * panels. */
VEC_INLINE void pairs_block(float *C, size_t ld, size_t rows, size_t n,
                            const uint32_t *A, size_t rs, size_t ks,
                            const uint32_t *B, size_t panel, size_t K,
                            bool add, const int wide)
{
    vf acc[PAIRS_ROWS][PAIRS_WIDE];

    for (int r = 0; r < PAIRS_ROWS; r++)
        for (int j = 0; j < wide; j++)
            acc[r][j] = (vf){ 0 };
    for (size_t k = 0; k < K; k++) {
        vu b[PAIRS_WIDE];

        for (int j = 0; j < wide; j++)
            b[j] = (vu)vi_load(B + k * PAIRS_PANEL +
                               (size_t)(j / VEC_PARTS) * panel +
                               (size_t)(j % VEC_PARTS) * VEC);
        for (int r = 0; r < PAIRS_ROWS; r++) {
            vu a = {VEC_ALL(A[(size_t)r * rs + k * ks])};

            for (int j = 0; j < wide; j++)
                acc[r][j] = pairs_dot(acc[r][j], a, b[j]);
        }
    }
    for (int r = 0; r < PAIRS_ROWS; r++)
        for (int j = 0; j < wide; j++) {
            size_t at = (size_t)j * VEC;
            size_t left = n < at ? 0 : n - at < VEC ? n - at : VEC;
            float *c = C + (size_t)r * ld + at;

            if ((size_t)r >= rows)
                continue;
            if (add)
                acc[r][j] += vf_load_some(c, left);
            vf_store_some(c, acc[r][j], left);
        }
}

#endif
