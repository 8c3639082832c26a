/* Cosine transforms of blocks, quantised, and their edges evened out. */
#include "lib/lab/people/scan_codec.h"

#include <math.h>

#include "lib/lab/people/blocks.h"

#define BLOCK 8

/* Round coefficients to multiples of a step (float), coarser for the finer
 * ones.  A dead zone: what is small is not worth its bits. */
static void codec_round(float b[64], const void *slowest)
{
    const float step = *(const float *)slowest;

    for (int i = 0; i < 64; i++) {
        float s = step * (1 + 0.10f * (float)(i % 8 + i / 8));
        float l = fabsf(b[i]) / s;

        l = i ? floorf(l + 0.30f) : rintf(l);
        b[i] = copysignf(l * s, b[i]);
    }
}

/* The four values about a border, at p, p + d, ...: a step smaller than the
 * limit is a fault of the blocks, and goes. */
static void codec_smooth_border(float *p, int d, float limit)
{
    float step = p[2 * d] - p[d];

    if (fabsf(step) > limit)
        return;
    p[0] += 0.125f * step;
    p[d] += 0.375f * step;
    p[2 * d] -= 0.375f * step;
    p[3 * d] -= 0.125f * step;
}

/* Across all borders of blocks, the upright ones first. */
static void codec_deblock(float *p, int n, float limit)
{
    for (int y = 0; y < n; y++)
        for (int x = BLOCK; x + 2 <= n; x += BLOCK)
            codec_smooth_border(p + y * n + x - 2, 1, limit);
    for (int y = BLOCK; y + 2 <= n; y += BLOCK)
        for (int x = 0; x < n; x++)
            codec_smooth_border(p + (y - 2) * n + x, n, limit);
}

void codec_damage(uint8_t *rgb, float *scratch, int n, int q)
{
    /* H.264's step doubles every six quantisers; 0.625 at 0 */
    const float step = 0.625f * exp2f((float)q / 6) * 1.6f;
    struct blocks b = blocks_split(scratch, rgb, n);

    blocks_quantise(b.luma, n, codec_round, &step);
    codec_deblock(b.luma, n, 2.0f * step);
    blocks_quantise(b.cb, b.m, codec_round, &step);
    blocks_quantise(b.cr, b.m, codec_round, &step);
    blocks_join(rgb, &b);
}
