/* Products of matrices in bfloat16 with sums in float.  Two neighbours along
 * the summed dimension lie in one 32-bit word, the first in its lower half,
 * as the processor's instruction for it wants them; 12 rows by 32 columns of
 * the result stay in registers. */
#include <stdbool.h>

#include "lib/nn/kernels.h"
#include "lib/nn/pointwise_kernel.h"
#include "lib/nn/vector.h"

#define P POINTWISE_PANEL
#define ROWS POINTWISE_ROWS
#define WIDE (2 * P / VF_LANES)  /* vectors of a row of the block */

/* acc + a0 b0 + a1 b1 in each lane; a, b: pairs of bfloat16. */
VF_INLINE vf pointwise_dot(vf acc, vf_u32 a, vf_u32 b)
{
#if defined(ISA_AVX512)
    return (vf)_mm512_dpbf16_ps((__m512)acc, (__m512bh)a, (__m512bh)b);
#else
    acc += (vf)(a << 16) * (vf)(b << 16);
    return acc + (vf)(a & 0xffff0000) * (vf)(b & 0xffff0000);
#endif
}

/* Pairs of a (lower half) and b, rounded to nearest even. */
VF_INLINE vf_u32 pointwise_pair(vf a, vf b)
{
#if defined(ISA_AVX512)
    const __m512i order = _mm512_set_epi16(
        31, 15, 30, 14, 29, 13, 28, 12, 27, 11, 26, 10, 25, 9, 24, 8, 23, 7,
        22, 6, 21, 5, 20, 4, 19, 3, 18, 2, 17, 1, 16, 0);
    __m512bh both = _mm512_cvtne2ps_pbh((__m512)b, (__m512)a);

    return (vf_u32)_mm512_permutexvar_epi16(order, (__m512i)both);
#else
    vf_u32 u = (vf_u32)a, v = (vf_u32)b;

    u = u + 0x7fff + ((u >> 16) & 1);
    v = v + 0x7fff + ((v >> 16) & 1);
    return u >> 16 | (v & 0xffff0000);
#endif
}

/* n <= VF_LANES values from p, zeros after them. */
VF_INLINE vf pointwise_load(const float *p, size_t n)
{
#if defined(ISA_AVX512)
    return (vf)_mm512_maskz_loadu_ps((__mmask16)((1u << n) - 1), p);
#else
    float lane[VF_LANES] = { 0 };

    for (size_t i = 0; i < n; i++)
        lane[i] = p[i];
    return vf_load(lane);
#endif
}

/* The first n <= VF_LANES values of x to p. */
VF_INLINE void pointwise_save(float *p, vf x, size_t n)
{
#if defined(ISA_AVX512)
    _mm512_mask_storeu_ps(p, (__mmask16)((1u << n) - 1), (__m512)x);
#else
    memcpy(p, &x, n * sizeof *p);
#endif
}

/* to (16) = pairs of the n <= 16 values of a and b, then pairs of zeros. */
VF_INLINE void pointwise_pair_rows(uint32_t *to, const float *a,
                                   const float *b, size_t n)
{
    for (size_t i = 0; i < P; i += VF_LANES) {
        size_t left = n < i ? 0 : n - i < VF_LANES ? n - i : VF_LANES;

        *(vf_u32 *)(to + i) = pointwise_pair(pointwise_load(a + i, left),
                                             pointwise_load(b + i, left));
    }
}

/* packed (N/16 up, K/2, 16) <- B, element (k,n) at B[k ks + n ns]; zeros
 * fill the last panel. */
void ISA(pointwise_pack)(uint32_t *packed, const float *B, size_t ks,
                         size_t ns, size_t K, size_t N)
{
    for (size_t n0 = 0; n0 < N; n0 += P) {
        size_t n = N - n0 < P ? N - n0 : P;

        for (size_t k = 0; k < K; k += 2, packed += P) {
            const float *p = B + k * ks + n0 * ns;

            float a[P] = { 0 }, b[P] = { 0 };
            for (size_t j = 0; j < n; j++) {
                a[j] = p[j * ns];
                b[j] = p[j * ns + ks];
            }
            pointwise_pair_rows(packed, a, b, P);
        }
    }
}

/* A row of K floats to bfloat16. */
VF_INLINE void pointwise_round(uint16_t *to, const float *row, size_t K)
{
#if defined(ISA_AVX512)
    for (size_t k = 0; k < K; k += 32) {
        size_t n = K - k < 32 ? K - k : 32, m = n < 16 ? n : 16;
        __m512bh h = _mm512_cvtne2ps_pbh(
            (__m512)pointwise_load(row + k + 16, n - m),
            (__m512)pointwise_load(row + k, m));

        _mm512_mask_storeu_epi16(to + k, (__mmask32)(((uint64_t)1 << n) - 1),
                                 (__m512i)h);
    }
#else
    for (size_t k = 0; k < K; k++) {
        uint32_t u;

        memcpy(&u, row + k, sizeof u);
        to[k] = (uint16_t)((u + 0x7fff + ((u >> 16) & 1)) >> 16);
    }
#endif
}

/* C (rows <= 12, n <= 32 columns, ld apart) = A B over K pairs, or += with
 * add: element (r,k) of A at A[r rs + k ks], B in `wide` vectors of one or two
 * panels. */
VF_INLINE void pointwise_block(float *C, size_t ld, size_t rows, size_t n,
                               const uint32_t *A, size_t rs, size_t ks,
                               const uint32_t *B, size_t panel, size_t K,
                               bool add, const int wide)
{
    vf acc[ROWS][WIDE];

    for (int r = 0; r < ROWS; r++)
        for (int j = 0; j < wide; j++)
            acc[r][j] = (vf){ 0 };
    for (size_t k = 0; k < K; k++) {
        vf_u32 b[WIDE];

        for (int j = 0; j < wide; j++)
            b[j] = *(const vf_u32 *)(B + k * P +
                                     (size_t)(j / VF_PARTS) * panel +
                                     (size_t)(j % VF_PARTS) * VF_LANES);
        for (int r = 0; r < ROWS; r++) {
            vf_u32 a = A[(size_t)r * rs + k * ks] - (vf_u32){ 0 };

            for (int j = 0; j < wide; j++)
                acc[r][j] = pointwise_dot(acc[r][j], a, b[j]);
        }
    }
    for (int r = 0; r < ROWS; r++)
        for (int j = 0; j < wide; j++) {
            size_t at = (size_t)j * VF_LANES;
            size_t left = n < at ? 0 : n - at < VF_LANES ? n - at : VF_LANES;
            float *c = C + (size_t)r * ld + at;

            if ((size_t)r >= rows)
                continue;
            if (add)
                acc[r][j] += pointwise_load(c, left);
            pointwise_save(c, acc[r][j], left);
        }
}

/* C (M,N) = A (M,K) times packed weights; half: room for 12 rounded rows. */
void ISA(pointwise_rows)(float *C, const float *A, uint32_t *half,
                         const uint32_t *packed, size_t M, size_t N, size_t K)
{
    size_t panel = K / 2 * P;

    for (size_t m = 0; m < M; m += ROWS) {
        size_t rows = M - m < ROWS ? M - m : ROWS;

        for (size_t r = 0; r < rows; r++)
            pointwise_round((uint16_t *)half + r * K, A + (m + r) * K, K);
        for (size_t n = 0; n < N; n += 2 * P) {
            const uint32_t *B = packed + n / P * panel;
            size_t left = N - n < 2 * P ? N - n : 2 * P;
            float *to = C + m * N + n;

            if (left > P)
                pointwise_block(to, N, rows, left, half, K / 2, 1, B, panel,
                                K / 2, false, WIDE);
            else
                pointwise_block(to, N, rows, left, half, K / 2, 1, B, panel,
                                K / 2, false, WIDE / 2);
        }
    }
}

/* dw (out, in up to 16) = dout (M,out) transposed times in (M,in); pairs:
 * room for 64 pairs of rows of both, and 12 words. */
void ISA(pointwise_weights)(float *dw, const float *dout, const float *in,
                            uint32_t *pairs, size_t M, size_t out,
                            size_t channels)
{
    static const float zero[P];
    size_t wide = (channels + P - 1) / P * P, R = 2 * POINTWISE_PAIRS;
    size_t ld = (out + P - 1) / P * P;
    uint32_t *x = pairs, *d = pairs + POINTWISE_PAIRS * wide;

    for (size_t m = 0; m < M || m == 0; m += R) {
        size_t n = M - m < R ? M - m : R, K = (n + 1) / 2;

        for (size_t k = 0; k < K; k++) {
            const float *a = dout + (m + 2 * k) * out;
            const float *p = in + (m + 2 * k) * channels;
            int odd = 2 * k + 1 == n;

            for (size_t o = 0; o < out; o += P)
                pointwise_pair_rows(d + k * ld + o, a + o,
                                    odd ? zero : a + out + o,
                                    out - o < P ? out - o : P);
            for (size_t c = 0; c < wide; c += P)
                pointwise_pair_rows(x + c * K + k * P, p + c,
                                    odd ? zero : p + channels + c,
                                    channels - c < P ? channels - c : P);
        }
        for (size_t c = 0; c < wide; c += 2 * P)
            for (size_t o = 0; o < out; o += ROWS) {
                size_t rows = out - o < ROWS ? out - o : ROWS;
                float *to = dw + o * wide + c;

                if (c + P < wide)
                    pointwise_block(to, wide, rows, 2 * P, d + o, 1, ld,
                                    x + c * K, K * P, K, m > 0, WIDE);
                else
                    pointwise_block(to, wide, rows, P, d + o, 1, ld,
                                    x + c * K, K * P, K, m > 0, WIDE / 2);
            }
    }
}
