/* The lattice and its trilinear weights; splines through a track's slots. */
#include "lib/lab/people/noise.h"

#include <math.h>

#include "lib/base/random.h"

#define NOISE_N 64

static uint32_t noise_lattice[NOISE_N * NOISE_N * NOISE_N];

void noise_lattice_fill(void)
{
    const uint64_t key = random_name("synth.noise");

    for (uint32_t i = 0; i < NOISE_N * NOISE_N * NOISE_N && !noise_lattice[i];
         i++)
        noise_lattice[i] = (uint32_t)(random_mix(key + i) >> 32) | 1;
}

/* The lattice repeats itself. */
static uint32_t noise_cell(int x, int y, int z)
{
    int m = NOISE_N - 1;
    int at = ((z & m) * NOISE_N + (y & m)) * NOISE_N + (x & m);

    return noise_lattice[at];
}

void noise4(float out[4], const float p[3])
{
    int i[3];
    float f[3], sum[4] = { 0, 0, 0, 0 };

    for (int k = 0; k < 3; k++) {
        float fl = floorf(p[k]);
        i[k] = (int)fl;
        f[k] = p[k] - fl;
        f[k] = f[k] * f[k] * (3 - 2 * f[k]);
    }
    for (int c = 0; c < 8; c++) {
        int a = c & 1, b = c >> 1 & 1, d = c >> 2;
        uint32_t v = noise_cell(i[0] + a, i[1] + b, i[2] + d);
        float w = (a ? f[0] : 1 - f[0]) * (b ? f[1] : 1 - f[1])
                  * (d ? f[2] : 1 - f[2]);
        for (int k = 0; k < 4; k++)
            sum[k] += w * (float)(v >> (8 * k) & 255);
    }
    for (int k = 0; k < 4; k++)
        out[k] = sum[k] * (2 / 255.0f) - 1;
}

float noise_sum(float x, float y, float z, int octaves)
{
    float sum = 0, weight = 1, out[4];

    for (int o = 0; o < octaves; o++) {
        float p[3] = { x + 17 * o, y + 31 * o, z + 47 * o };
        noise4(out, p);
        sum += weight * out[0];
        weight *= 0.5f;
        x *= 2;
        y *= 2;
        z *= 2;
    }
    return sum;
}

float noise_slot(uint64_t track, int64_t i)
{
    return (float)(random_mix(track + (uint64_t)i) >> 40)
           * (1.0f / 16777216.0f);
}

float noise_time(uint64_t track, double time, double period)
{
    double x = time / period + 1000 + (double)noise_slot(track, -7);
    int64_t i = (int64_t)floor(x);
    float f = (float)(x - (double)i), y[4];

    for (int k = 0; k < 4; k++)
        y[k] = 2 * noise_slot(track, i - 1 + k) - 1;
    /* cubic B-spline: two continuous derivatives */
    float g = 1 - f, f2 = f * f, f3 = f2 * f;
    return 1.35f * (g * g * g * y[0] + (3 * f3 - 6 * f2 + 4) * y[1]
                    + (-3 * f3 + 3 * f2 + 3 * f + 1) * y[2] + f3 * y[3]) / 6;
}
