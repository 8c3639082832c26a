/* The inner loops of crop.c, compiled once per instruction set. */
#include "lib/base/crop_kernel.h"

#include <string.h>

typedef float v4f __attribute__((vector_size(16)));

/* Two rows of bytes to one of floats. */
void ISA(crop_blend)(float *row, const uint8_t *a, const uint8_t *b, float w,
                     size_t n)
{
    const float wa = (1 - w) / 255, wb = w / 255;

    for (size_t i = 0; i < n; i++)
        row[i] = (float)a[i] * wa + (float)b[i] * wb;
}

/* Four floats at a time, of which three count. */
void ISA(crop_gather)(float *out, const float *row, const int32_t *at,
                      const float *w, size_t n)
{
    for (size_t i = 0; i < n; i++, out += 3) {
        v4f p, q;

        memcpy(&p, row + at[i], sizeof p);
        memcpy(&q, row + at[i] + 3, sizeof q);
        p += (q - p) * w[i];
        memcpy(out, &p, sizeof p);     /* the fourth is written over next */
    }
}

/* Means of 2x2 pixels, rounded. */
void ISA(crop_halve)(uint8_t *out, const uint8_t *a, const uint8_t *b,
                     size_t w)
{
    for (size_t i = 0; i < w; i++, a += 6, b += 6, out += 3)
        for (int k = 0; k < 3; k++)
            out[k] = (uint8_t)((a[k] + a[k + 3] + b[k] + b[k + 3] + 2) >> 2);
}

/* Bytes to floats. */
void ISA(crop_widen)(float *out, const uint8_t *in, size_t n)
{
    for (size_t i = 0; i < n; i++)
        out[i] = in[i];
}

/* Floats to bytes. */
void ISA(crop_round)(uint8_t *out, const float *in, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        const float up = in[i] + 0.5f;

        out[i] = (uint8_t)(int)(up < 0 ? 0 : up > 255 ? 255 : up);
    }
}
