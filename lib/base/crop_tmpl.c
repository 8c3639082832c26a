/* The inner loops of crop.c, compiled once per instruction set. */
#include "lib/base/crop_kernel.h"

#include <string.h>

#include "lib/base/quad.h"

typedef uint8_t v8b __attribute__((vector_size(8)));
typedef uint16_t v8h __attribute__((vector_size(16)));

/* Two rows of bytes to one of floats. */
static void crop_blend_rows(float *row, const uint8_t *a, const uint8_t *b,
                            float w, size_t n)
{
    const float wa = (1 - w) / 255, wb = w / 255;

    for (size_t i = 0; i < n; i++)
        row[i] = (float)a[i] * wa + (float)b[i] * wb;
}

/* Four floats at a time, of which three count. */
static void crop_gather_row(float *out, const float *row, const int32_t *at,
                            const float *w, size_t n)
{
    for (size_t i = 0; i < n; i++, out += 3) {
        const quad p = *(const quad *)(row + at[i]);
        const quad q = *(const quad *)(row + at[i] + 3);

        *(quad *)out = p + (q - p) * w[i];  /* the fourth: the next's first */
    }
}

#define HALVED 64               /* pixels at a time */

/* Means of 2x2 pixels, rounded: sums of both rows, then of neighbours eight
 * numbers at a time, of which three count. */
static void crop_halve_rows(uint8_t *out, const uint8_t *a, const uint8_t *b,
                            size_t w)
{
    for (size_t i = 0, n; i < w; i += n, a += 6 * n, b += 6 * n) {
        uint16_t sum[6 * HALVED + 8];

        n = w - i < HALVED ? w - i : HALVED;
        for (size_t k = 0; k < 6 * n; k++)
            sum[k] = (uint16_t)(a[k] + b[k] + 1);
        for (size_t k = 0; k < n; k++, out += 3) {
            v8h p, q;

            memcpy(&p, sum + 6 * k, sizeof p);
            memcpy(&q, sum + 6 * k + 3, sizeof q);
            const v8b mean = __builtin_convertvector((p + q) >> 2, v8b);
            memcpy(out, &mean, 3);
        }
    }
}

/* Bytes are added, weighted. */
static void crop_add_row(float *sum, const uint8_t *in, float w, size_t n)
{
    for (size_t i = 0; i < n; i++)
        sum[i] += w * in[i];
}

/* Floats to bytes. */
static void crop_round_row(uint8_t *out, const float *in, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        const float up = in[i] + 0.5f;

        out[i] = (uint8_t)(int)(up < 0 ? 0 : up > 255 ? 255 : up);
    }
}

const struct crop_kernels ISA(crop_kernels) = {
    crop_blend_rows, crop_gather_row, crop_halve_rows, crop_add_row,
    crop_round_row
};
