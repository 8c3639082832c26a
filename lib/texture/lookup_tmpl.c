/* Bicubic lookups (Catmull and Rom 1974) in a picture of four bytes a pixel:
 * four lanes are a pixel's four channels, so the code is the same for every
 * instruction set and only its width differs. */
#include "lib/texture/lookup_kernel.h"

#include <math.h>
#include <string.h>

typedef float lookup4 __attribute__((vector_size(16)));
typedef int32_t mask4 __attribute__((vector_size(16)));
typedef uint8_t bytes4 __attribute__((vector_size(4)));

/* Each lane held between 0 and 1: the cubic overshoots at edges. */
static inline lookup4 lookup_hold(lookup4 c)
{
    const mask4 one = (mask4)(lookup4){1, 1, 1, 1};
    mask4 big = c > 1.0f;

    return (lookup4)(((mask4)c & (c > 0.0f) & ~big) | (one & big));
}

/* Weights of the four neighbours at t in [0,1) past the second. */
static inline void lookup_weights(float w[4], float t)
{
    float t2 = t * t, t3 = t2 * t;

    w[0] = -0.5f * t3 + t2 - 0.5f * t;
    w[1] = 1.5f * t3 - 2.5f * t2 + 1;
    w[2] = -1.5f * t3 + 2 * t2 + 0.5f * t;
    w[3] = 0.5f * t3 - 0.5f * t2;
}

static inline lookup4 lookup_pixel(const uint8_t *p)
{
    bytes4 b;

    memcpy(&b, p, sizeof b);
    return __builtin_convertvector(b, lookup4);
}

/* Index i of n pixels, held inside. */
static inline size_t lookup_clamp(long i, long n)
{
    return (size_t)(i < 0 ? 0 : i >= n ? n - 1 : i);
}

static inline lookup4 lookup_at(const uint8_t *texture, size_t S, float u,
                                float v)
{
    const float end = (float)S;
    /* what is far outside is the border's anyway; NaN becomes the corner */
    float x = fminf(fmaxf(u, -2), end + 2) - 0.5f;
    float y = fminf(fmaxf(v, -2), end + 2) - 0.5f;
    float fx = floorf(x), fy = floorf(y), wx[4], wy[4];
    long x0 = (long)fx - 1, y0 = (long)fy - 1, n = (long)S;
    lookup4 sum = {0};

    lookup_weights(wx, x - fx);
    lookup_weights(wy, y - fy);
    if (x0 >= 0 && y0 >= 0 && x0 + 3 < n && y0 + 3 < n) {
        const uint8_t *row = texture + 4 * ((size_t)y0 * S + (size_t)x0);
        for (int j = 0; j < 4; j++, row += 4 * S)
            sum += wy[j] * (wx[0] * lookup_pixel(row) +
                            wx[1] * lookup_pixel(row + 4) +
                            wx[2] * lookup_pixel(row + 8) +
                            wx[3] * lookup_pixel(row + 12));
        return sum;
    }
    for (int j = 0; j < 4; j++) {
        const uint8_t *row = texture + 4 * S * lookup_clamp(y0 + j, n);
        for (int i = 0; i < 4; i++)
            sum += wy[j] * wx[i] *
                   lookup_pixel(row + 4 * lookup_clamp(x0 + i, n));
    }
    return sum;
}

void ISA(texture_bicubic)(float *out, size_t stride, const float *uv,
                          const float *weight, size_t n,
                          const uint8_t *texture, size_t S)
{
    for (size_t i = 0; i < n; i++) {
        if (!(weight[i] > 0))
            continue;
        lookup4 c = lookup_hold(lookup_at(texture, S, uv[2 * i],
                                          uv[2 * i + 1]) * (1.0f / 255));
        memcpy(out + i * stride, &c, sizeof c);
    }
}
