/* Small matrix products in one thread: the inner loop of Winograd and of
 * attention, where oneDNN's own would start threads.  B is packed once into
 * panels of 32 columns. */
#include "lib/nn/kernels.h"
#include "lib/nn/math.h"
#include "lib/nn/vector.h"

#define PANEL 32
/* A block of the result stays in registers: ROWS by COLUMNS. */
#if defined(ISA_AVX512)
#define ROWS 12          /* 24 accumulators */
#define COLUMNS 32
#elif defined(ISA_AVX2)
#define ROWS 6           /* 12 */
#define COLUMNS 16
#else
#define ROWS 5           /* 10: SSE and WebAssembly have 16 registers, of
                          * which B takes two, A and a product one each */
#define COLUMNS 8
#endif
#define WIDE (COLUMNS / VEC)

/* packed (N/32 up, K, 32) <- B, element (k,n) at B[k rs + n cs]; zeros fill
 * the last panel. */
void ISA(gemm_pack)(float *packed, const float *B, size_t rs, size_t cs,
                    size_t K, size_t N)
{
    for (size_t n0 = 0; n0 < N; n0 += PANEL) {
        size_t n = N - n0 < PANEL ? N - n0 : PANEL;

        for (size_t k = 0; k < K; k++, packed += PANEL) {
            const float *p = B + k * rs + n0 * cs;

            for (size_t j = 0; j < n; j++)
                packed[j] = p[j * cs];
            for (size_t j = n; j < PANEL; j++)
                packed[j] = 0;
        }
    }
}

/* C block of `rows` by n columns, in `wide` vectors (constants both but n). */
VEC_INLINE void gemm_block(float *C, size_t ldc, const float *A, size_t rs,
                           size_t cs, const float *B, size_t K, size_t n,
                           const float *more, size_t ldm, const int rows,
                           const int wide)
{
    vf acc[ROWS][WIDE];

    for (int r = 0; r < rows; r++)
        for (int j = 0; j < wide; j++)
            acc[r][j] = (vf){ 0 };
    for (size_t k = 0; k < K; k++) {
        vf b[WIDE];
        for (int j = 0; j < wide; j++)
            b[j] = vf_load(B + k * PANEL + VEC * j);
        for (int r = 0; r < rows; r++) {
            float a = A[(size_t)r * rs + k * cs];

            for (int j = 0; j < wide; j++)
                acc[r][j] += a * b[j];
        }
    }
#pragma GCC unroll 12
    for (int r = 0; r < rows; r++)
#pragma GCC unroll 4
        for (int j = 0; j < wide; j++) {
            const size_t left = n - VEC * (size_t)j;
            const float *from = more + (size_t)r * ldm + VEC * j;
            float *c = C + (size_t)r * ldc + VEC * j;

            if (more && left < VEC)
                acc[r][j] += vf_load_some(from, left);
            else if (more)
                acc[r][j] += vf_load(from);
            if (left < VEC)
                vf_store_some(c, acc[r][j], left);
            else
                vf_store(c, acc[r][j]);
        }
}

/* All M rows of n columns. */
VEC_INLINE void gemm_columns(float *C, size_t ldc, const float *A, size_t rs,
                             size_t cs, const float *B, size_t M, size_t K,
                             size_t n, const float *more, size_t ldm,
                             const int wide)
{
    for (; M >= ROWS; M -= ROWS, C += ROWS * ldc, A += ROWS * rs) {
        gemm_block(C, ldc, A, rs, cs, B, K, n, more, ldm, ROWS, wide);
        more = more ? more + ROWS * ldm : NULL;
    }
    for (; M >= 3; M -= 3, C += 3 * ldc, A += 3 * rs) {
        gemm_block(C, ldc, A, rs, cs, B, K, n, more, ldm, 3, wide);
        more = more ? more + 3 * ldm : NULL;
    }
    for (; M; M--, C += ldc, A += rs) {
        gemm_block(C, ldc, A, rs, cs, B, K, n, more, ldm, 1, wide);
        more = more ? more + ldm : NULL;
    }
}

/* C (M,N), rows ldc apart, = A B + more, whose rows are ldm apart (0: it is one
 * row; NULL: nothing); A's element (m,k) at A[m rs + k cs], B from gemm_pack. */
void ISA(gemm)(float *C, size_t ldc, const float *A, size_t rs, size_t cs,
               const float *packed, size_t M, size_t N, size_t K,
               const float *more, size_t ldm)
{
    for (size_t n0 = 0; n0 < N; n0 += COLUMNS) {
        const float *B = packed + n0 / PANEL * PANEL * K + n0 % PANEL;
        const size_t n = N - n0 < COLUMNS ? N - n0 : COLUMNS;
        const float *from = more ? more + n0 : NULL;

        if (n > COLUMNS / 2)
            gemm_columns(C + n0, ldc, A, rs, cs, B, M, K, n, from, ldm, WIDE);
        else
            gemm_columns(C + n0, ldc, A, rs, cs, B, M, K, n, from, ldm,
                         WIDE / 2);
    }
}

/* Each row of n values (rows ld apart) <- softmax(scale row). */
void ISA(softmax)(float *p, size_t rows, size_t n, size_t ld, float scale)
{
    for (size_t r = 0; r < rows; r++) {
        float *restrict row = p + r * ld;
        float lane[16], sum = 0, max;
        size_t whole = n / 16 * 16;

        for (int i = 0; i < 16; i++)
            lane[i] = row[0];
        for (size_t k = 0; k < whole; k += 16)
            for (int i = 0; i < 16; i++)
                lane[i] = row[k + (size_t)i] > lane[i] ? row[k + (size_t)i]
                                                       : lane[i];
        max = lane[0];
        for (int i = 1; i < 16; i++)
            max = lane[i] > max ? lane[i] : max;
        for (size_t k = whole; k < n; k++)
            max = row[k] > max ? row[k] : max;
        for (size_t k = 0; k < n; k++)
            row[k] = math_exp((row[k] - max) * scale);
        for (int i = 0; i < 16; i++)
            lane[i] = 0;
        for (size_t k = 0; k < whole; k += 16)
            for (int i = 0; i < 16; i++)
                lane[i] += row[k + (size_t)i];
        for (int i = 0; i < 16; i++)
            sum += lane[i];
        for (size_t k = whole; k < n; k++)
            sum += row[k];
        float unit = 1 / sum;
        for (size_t k = 0; k < n; k++)
            row[k] *= unit;
    }
}

/* dp <- scale p (dp - sum over the row of p dp): from the gradient of the
 * probabilities to that of the logits. */
void ISA(softmax_backward)(float *dp, const float *p, size_t rows, size_t n,
                           size_t ld, float scale)
{
    for (size_t r = 0; r < rows; r++) {
        float *restrict d = dp + r * ld;
        const float *restrict q = p + r * ld;
        float lane[16] = { 0 }, sum = 0;

        for (size_t k = 0; k < n; k += 16)
            for (size_t i = 0; i < 16 && k + i < n; i++)
                lane[i] += d[k + i] * q[k + i];
        for (int i = 0; i < 16; i++)
            sum += lane[i];
        for (size_t k = 0; k < n; k++)
            d[k] = scale * q[k] * (d[k] - sum);
    }
}
