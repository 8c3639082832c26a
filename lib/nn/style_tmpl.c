/* The elementwise parts of StyleGAN's layers, one pass each. */
#include "lib/nn/act.h"
#include "lib/nn/kernels.h"

/* y = lrelu(u d + gain noise + b), rows of C; noise one value per row. */
void ISA(style_finish)(float *y, const float *u, const float *d,
                       const float *b, const float *noise, float gain,
                       size_t rows, size_t C)
{
    for (size_t r = 0; r < rows; r++) {
        const float *p = u + r * C;
        float *q = y + r * C, n = gain * noise[r];
        KERNEL_INDEPENDENT
        for (size_t c = 0; c < C; c++) {
            float z = p[c] * d[c] + (n + b[c]);

            q[c] = z > 0 ? z : ACT_SLOPE * z;
        }
    }
}

/* With dz = dy lrelu'(y): du = dz d; sum (3,C) = column sums of dz, dz u and
 * dz noise. */
void ISA(style_backward)(float *du, float *sum, const float *dy,
                         const float *y, const float *u, const float *d,
                         const float *noise, size_t rows, size_t C)
{
    float *restrict s0 = sum, *restrict s1 = sum + C, *restrict s2 = s1 + C;

    for (size_t c = 0; c < 3 * C; c++)
        sum[c] = 0;
    for (size_t r = 0; r < rows; r++) {
        const float *p = u + r * C, *q = y + r * C, *g = dy + r * C;
        float *to = du + r * C, n = noise[r];
        KERNEL_INDEPENDENT
        for (size_t c = 0; c < C; c++) {
            float dz = g[c] * (q[c] > 0 ? 1 : ACT_SLOPE);

            s0[c] += dz;
            s1[c] += dz * p[c];
            s2[c] += dz * n;
            to[c] = dz * d[c];
        }
    }
}
