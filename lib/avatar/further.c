/* Sums over further pictures (further.h). */
#include "lib/avatar/further.h"

#include <math.h>

#define BOTH 10.0       /* points: of white, counted in with what two pictures
                         * have in common; no gain is known where that is
                         * nothing */

/* A point's weight. */
static float further_weight(float trust, float facing)
{
    const float area = trust * fmaxf(facing, 0);

    return area * area;
}

void further_gain(float gain[3], const struct further_picture *p,
                  const float *known, size_t N)
{
    double own[3] = {BOTH, BOTH, BOTH}, first[3] = {BOTH, BOTH, BOTH};

    for (size_t k = 0; k < N; k++)
        for (size_t c = 0; c < 3; c++) {
            const float w = p->trust[k] * known[4 * k + 3];

            own[c] += (double)(w * p->pixel[4 * k + c]);
            first[c] += (double)(w * known[4 * k + c]);
        }
    for (int c = 0; c < 3; c++)
        gain[c] = (float)sqrt(first[c] / own[c]);
}

void further_add(float *sums, const struct further_picture *p,
                 const float gain[3], size_t N)
{
    for (size_t k = 0; k < N; k++) {
        const float w = further_weight(p->trust[k], p->facing[k]);
        float *sum = sums + FURTHER_SUMS * k;

        for (size_t c = 0; c < 3; c++)
            sum[c] += w * fminf(gain[c] * p->pixel[4 * k + c], 1);
        sum[3] += w;
        sum[4] = fmaxf(sum[4], w > 0 ? p->trust[k] : 0);
    }
}

void further_take(float *pixel, float *trust, float *rgb, const float *facing,
                  const float *sums, size_t N)
{
    for (size_t k = 0; k < N; k++) {
        const float *sum = sums + FURTHER_SUMS * k;
        const float w = further_weight(trust[k], facing[k]) + sum[3];

        if (!(sum[3] > 0))
            continue;
        for (size_t c = 0; c < 3; c++) {
            float *to = pixel + 4 * k + c;

            *to += (sum[c] - sum[3] * *to) / w;
            rgb[3 * k + c] = *to;
        }
        trust[k] = fmaxf(trust[k], sum[4]);
    }
}
