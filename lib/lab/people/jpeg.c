/* JPEG's damage without its file: planes and cosine blocks (blocks.h), rounded
 * to the usual tables scaled by quality. */
#include "lib/lab/people/lens.h"

#include <math.h>
#include <stdbool.h>

#include "lib/lab/people/blocks.h"

static const uint8_t jpeg_luma[64] = {
    16, 11, 10, 16, 24, 40, 51, 61, 12, 12, 14, 19, 26, 58, 60, 55,
    14, 13, 16, 24, 40, 57, 69, 56, 14, 17, 22, 29, 51, 87, 80, 62,
    18, 22, 37, 56, 68, 109, 103, 77, 24, 35, 55, 64, 81, 104, 113, 92,
    49, 64, 78, 87, 103, 121, 120, 101, 72, 92, 95, 98, 112, 100, 103, 99
};

/* How a plane's coefficients are rounded. */
struct jpeg_table {
    int quality;
    bool chroma;
};

/* To multiples of the table's steps, at least 1. */
static void jpeg_round(float b[64], const void *table)
{
    const struct jpeg_table *t = table;
    int scale = t->quality < 50 ? 5000 / t->quality : 200 - 2 * t->quality;

    for (int i = 0; i < 64; i++) {
        int low = i % 8 + i / 8, base = jpeg_luma[i];

        if (t->chroma)
            base = low < 4 ? 20 + 8 * low : 99;
        float q = (float)((base * scale + 50) / 100);
        q = q < 1 ? 1 : q;
        b[i] = rintf(b[i] / q) * q;
    }
}

void jpeg_damage(uint8_t *rgb, float *scratch, int n, int quality)
{
    const struct jpeg_table luma = {quality, false}, chroma = {quality, true};
    struct blocks b = blocks_split(scratch, rgb, n);

    blocks_quantise(b.luma, n, jpeg_round, &luma);
    blocks_quantise(b.cb, b.m, jpeg_round, &chroma);
    blocks_quantise(b.cr, b.m, jpeg_round, &chroma);
    blocks_join(rgb, &b);
}
