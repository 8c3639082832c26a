/* Small grey pictures of face crops, and how alike two are. */
#include "lib/track/thumb.h"

#include <math.h>
#include <stddef.h>

#include "lib/base/crop.h"

double thumb_make(float *thumb, const float *input)
{
    const size_t n = THUMB, cell = CROP_NET / n;
    double sum = 0, square = 0, scale;

    for (size_t y = 0; y < n; y++)
        for (size_t x = 0; x < n; x++) {
            float v = 0;
            for (size_t i = 0; i < cell; i += 2) {
                const float *p = input + 3 * ((y * cell + i) * CROP_NET
                                              + x * cell);
                for (size_t k = 0; k < 3 * cell; k++)
                    v += p[k];
            }
            thumb[y * n + x] = v / (float)(3 * cell * cell / 2);
            sum += thumb[y * n + x];
        }
    sum /= (double)(n * n);
    for (size_t i = 0; i < n * n; i++) {
        thumb[i] -= (float)sum;
        square += (double)thumb[i] * thumb[i];
    }
    scale = square > 0 ? 1 / sqrt(square) : 0;
    for (size_t i = 0; i < n * n; i++)
        thumb[i] *= (float)scale;
    return sqrt(square / (double)(n * n));
}

double thumb_correlate(const float *a, const float *b)
{
    double sum = 0;

    for (size_t i = 0; i < THUMB * THUMB; i++)
        sum += (double)a[i] * b[i];
    return sum;
}
