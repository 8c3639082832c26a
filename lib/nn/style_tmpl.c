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

            q[c] = z > 0.0f ? z : ACT_SLOPE * z;
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
        sum[c] = 0.0f;
    for (size_t r = 0; r < rows; r++) {
        const float *p = u + r * C, *q = y + r * C, *g = dy + r * C;
        float *to = du + r * C, n = noise[r];
        KERNEL_INDEPENDENT
        for (size_t c = 0; c < C; c++) {
            float dz = g[c] * (q[c] > 0.0f ? 1.0f : ACT_SLOPE);

            s0[c] += dz;
            s1[c] += dz * p[c];
            s2[c] += dz * n;
            to[c] = dz * d[c];
        }
    }
}

/* rgb (rows,3) += x (rows,C) w^T + b; w (3,C). */
void ISA(rgb_forward)(float *rgb, const float *x, const float *w,
                      const float *b, size_t rows, size_t C)
{
    for (size_t r = 0; r < rows; r++) {
        float lane[3][16] = { { 0 } };
        const float *p = x + r * C;
        size_t whole = C / 16 * 16;

        for (size_t c = 0; c < whole; c += 16)
            for (size_t o = 0; o < 3; o++)
                for (size_t i = 0; i < 16; i++)
                    lane[o][i] += p[c + i] * w[o * C + c + i];
        for (size_t o = 0; o < 3; o++) {
            float s8[8], sum;

            for (int i = 0; i < 8; i++)
                s8[i] = lane[o][i] + lane[o][i + 8];
            sum = ((s8[0] + s8[4]) + (s8[1] + s8[5])) +
                  ((s8[2] + s8[6]) + (s8[3] + s8[7]));
            for (size_t c = whole; c < C; c++)
                sum += p[c] * w[o * C + c];
            rgb[3 * r + o] += sum + b[o];
        }
    }
}

/* dx += drgb w; sum (3,C) = drgb^T x. */
void ISA(rgb_backward)(float *dx, float *sum, const float *drgb,
                       const float *x, const float *w, size_t rows, size_t C)
{
    const float *w1 = w + C, *w2 = w1 + C;
    float *restrict s0 = sum, *restrict s1 = sum + C, *restrict s2 = s1 + C;

    for (size_t c = 0; c < 3 * C; c++)
        sum[c] = 0.0f;
    for (size_t r = 0; r < rows; r++) {
        float a = drgb[3 * r], b = drgb[3 * r + 1], e = drgb[3 * r + 2];
        const float *p = x + r * C;
        float *d = dx + r * C;
        KERNEL_INDEPENDENT
        for (size_t c = 0; c < C; c++) {
            d[c] += a * w[c] + b * w1[c] + e * w2[c];
            s0[c] += a * p[c];
            s1[c] += b * p[c];
            s2[c] += e * p[c];
        }
    }
}
