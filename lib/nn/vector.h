/* What lib/nn's kernels need beside lib/base/simd.h: elementary functions of
 * vectors.  Private to them. */
#ifndef SPID_NN_VECTOR_H
#define SPID_NN_VECTOR_H

#include "lib/base/simd.h"
#include "lib/nn/math.h"

/* x, loaded once: GCC would read it again for every use of 128 bits, where no
 * instruction multiplies from an unaligned address. */
VEC_INLINE vf vf_once(vf x)
{
#if VEC == 4 && defined(__SSE2__)
    __asm__("" : "+x"(x));
#endif
    return x;
}

/* To bfloat16, the upper half of a float, rounded to nearest even. */
VEC_INLINE void vf_store_bf16(uint16_t *p, vf a)
{
    vu u = (vu)a;
    vh half = __builtin_convertvector((u + 0x7fff + (u >> 16 & 1)) >> 16, vh);

    memcpy(p, &half, sizeof half);
}

/* e^x, and below the sigmoid and tanh: math.h's, to the bit. */
VEC_INLINE vf vf_exp(vf x)
{
    x = vf_max(vf_set(-87), x);
    x = vf_min(vf_set(87), x);
    vf magic = vf_set(12582912);
    vf n = (x * 1.44269504f + magic) - magic;
    vf r = (x - n * 0.693359375f) - n * -2.12194440e-4f;
    vf p = vf_set(1.9875691500e-4f);
    MATH_EXP_SERIES(p, r);
    return p * (vf)((__builtin_convertvector(n, vi) + 127) << 23);
}

/* 1 / (1 + e^-x) */
VEC_INLINE vf vf_sigmoid(vf x)
{
    return 1 / (1 + vf_exp(-x));
}

/* tanh by e^2x */
VEC_INLINE vf vf_tanh(vf x)
{
    return 1 - 2 / (1 + vf_exp(2 * x));
}

#endif
