/* 1x1 convolutions by products of pairs (pairs.h): packing of weights, and the
 * three products. */
#include "lib/nn/kernels.h"
#include "lib/nn/pairs.h"
#include "lib/nn/pointwise.h"

#define P PAIRS_PANEL
#define ROWS PAIRS_ROWS
#define WIDE PAIRS_WIDE

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
            pairs_round_rows(packed, a, b, P);
        }
    }
}

/* A row of K floats to bfloat16. */
VEC_INLINE void pointwise_round(uint16_t *to, const float *row, size_t K)
{
#if defined(ISA_AVX512)
    for (size_t k = 0; k < K; k += 32) {
        size_t n = K - k < 32 ? K - k : 32, m = n < 16 ? n : 16;
        __m512bh h = _mm512_cvtne2ps_pbh(
            (__m512)vf_load_some(row + k + 16, n - m),
            (__m512)vf_load_some(row + k, m));

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
                pairs_block(to, N, rows, left, half, K / 2, 1, B, panel,
                                K / 2, false, WIDE);
            else
                pairs_block(to, N, rows, left, half, K / 2, 1, B, panel,
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
                pairs_round_rows(d + k * ld + o, a + o,
                                    odd ? zero : a + out + o,
                                    out - o < P ? out - o : P);
            for (size_t c = 0; c < wide; c += P)
                pairs_round_rows(x + c * K + k * P, p + c,
                                    odd ? zero : p + channels + c,
                                    channels - c < P ? channels - c : P);
        }
        for (size_t c = 0; c < wide; c += 2 * P)
            for (size_t o = 0; o < out; o += ROWS) {
                size_t rows = out - o < ROWS ? out - o : ROWS;
                float *to = dw + o * wide + c;

                if (c + P < wide)
                    pairs_block(to, wide, rows, 2 * P, d + o, 1, ld,
                                    x + c * K, K * P, K, m > 0, WIDE);
                else
                    pairs_block(to, wide, rows, P, d + o, 1, ld,
                                    x + c * K, K * P, K, m > 0, WIDE / 2);
            }
    }
}
