#include "formats/compose.h"

#include "formats/safetensors.h"
#include "lib/base/cpu.h"

static uint8_t level(float v)
{
    v += 0.5f;
    if (!(v > 0.0f))
        return 0;
    return v < 255.0f ? (uint8_t)v : 255;
}

void compose_c(uint8_t *out, const float *color, const float *alpha,
               const uint8_t *bg, size_t bg_step, size_t n)
{
    for (size_t i = 0; i < n; i++, bg += bg_step)
        for (size_t k = 0; k < 3; k++)
            out[3 * i + k] = level(color[3 * i + k] * 255.0f
                                   + (1.0f - alpha[i]) * bg[k]);
}

void compose_quantise_c(uint8_t *out, const float *x, size_t n)
{
    for (size_t i = 0; i < n; i++)
        out[i] = level(x[i] * 255.0f);
}

void compose_half_c(uint16_t *out, const float *x, size_t n)
{
    for (size_t i = 0; i < n; i++)
        out[i] = float_to_half(x[i]);
}

const struct compose_table *compose_table(void)
{
    static const struct compose_table plain = {
        compose_c, compose_quantise_c, compose_half_c
    };
#ifdef SPID_X86
    static const struct compose_table avx2 = {
        compose_avx2, compose_quantise_avx2, compose_half_avx2
    };
    static const struct compose_table avx512 = {
        compose_avx512, compose_quantise_avx512, compose_half_avx512
    };

    switch (cpu_level()) {
    case CPU_AVX512: return &avx512;
    case CPU_AVX2: return &avx2;
    default: break;
    }
#endif
    return &plain;
}
