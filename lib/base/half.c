/* IEEE half precision and bfloat16, converted number by number with integer
 * arithmetic, or many at a time; the kernels have vectors of their own. */
#include "lib/base/half.h"

#include <math.h>
#include <string.h>

#include "lib/base/cpu.h"

/* The upper half of a float's bits. */
float bf16_to_float(uint16_t h)
{
    uint32_t u = (uint32_t)h << 16;
    float f;

    memcpy(&f, &u, 4);
    return f;
}

/* A subnormal half is a normal float, a multiple of 2^-24; for the rest the
 * exponent's bias changes from 15 to 127. */
float half_to_float(uint16_t h)
{
    const uint32_t m = h & 0x3ff, e = h & 0x7c00;
    const float small = (float)(int32_t)m * 0x1p-24f;
    uint32_t u = (uint32_t)(h & 0x7fff) << 13, tiny;
    float f;

    memcpy(&tiny, &small, 4);
    u += e == 0x7c00 ? 224u << 23 : 112u << 23;
    u = (e ? u : tiny) | (uint32_t)(h & 0x8000) << 16;
    memcpy(&f, &u, 4);
    return f;
}

void half_to_floats(float *out, const void *in, size_t n)
{
    CPU_PICK(half_widen)(out, in, n);
}

/* To nearest, ties to even, by adding just under half of what is cut off, with
 * the bias changed back; what is below the smallest
 * normal half is rounded as a multiple of 2^-24. */
uint16_t float_to_half(float f)
{
    uint32_t u;

    memcpy(&u, &f, 4);
    uint16_t sign = (uint16_t)(u >> 16 & 0x8000);
    u &= 0x7fffffff;
    if (u > 0x7f800000)                          /* NaN */
        return sign | 0x7e00;
    if (u >= 0x477ff000)                         /* rounds to infinity */
        return sign | 0x7c00;
    if (u < 0x38800000) {                        /* subnormal in half */
        float a;

        memcpy(&a, &u, 4);
        return sign | (uint16_t)lrintf(ldexpf(a, 24));
    }
    u += 0xfff + (u >> 13 & 1);
    return sign | (uint16_t)((u - 0x38000000) >> 13);
}
