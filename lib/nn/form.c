/* The cost model of convolutions; tests/unit/nn_form.c measures it again. */
#include "lib/nn/form.h"

#include <math.h>
#include <stdbool.h>

#include "lib/base/cpu.h"
#include "lib/nn/engine.h"

/* Beside the products, fitted to the layers of tests/unit/nn_form.c on a Xeon
 * (Sapphire Rapids) and to times of an EPYC (Zen 4): cycles to bring a value of
 * the input to the type, and of Winograd the share of the direct form's
 * products that it makes and what its transforms cost for each channel. */
#define TO_BF16 1.0
#define TO_INT8 1.5
#define WINOGRAD_SHARE 0.28
#define WINOGRAD_TRANSFORM 4.9

static enum form preferred;

void form_prefer(enum form f)
{
    preferred = f;
}

/* By the instructions' throughput.  AMD's make products of bfloat16 at twice the
 * rate of float's, Intel's on one of float's two ports at the same rate.  Of the
 * tiles' 512 and 1,024 oneDNN reaches less than half. */
struct form_rates form_rates(void)
{
    const bool tiles = nn_has(dnnl_cpu_isa_avx512_core_amx);
    const bool two = cpu_is_intel() && cpu_level() == CPU_AVX512;
    struct form_rates r = { .f32 = two ? 32 : 16, .abreast = tiles ? 32 : 2 };

    if (nn_has(dnnl_cpu_isa_avx512_core_vnni))
        r.int8 = tiles ? 400 : 4 * r.f32;
    if (nn_has(dnnl_cpu_isa_avx512_core_bf16))
        r.bf16 = tiles ? 300 : two ? r.f32 : 2 * r.f32;
    return r;
}

/* Cycles for each output pixel; INFINITY: the form does not do such layers. */
static double form_cycles(enum form f, const struct form_layer *l,
                          const struct form_rates *r)
{
    const double in = (double)l->in, out = (double)l->out;
    const double taps = (double)(l->kernel * l->kernel);
    const double products = in * out * taps;
    const double read = in * (double)(l->stride * l->stride);
    const bool whole = l->in % 16 == 0 && l->out % 16 == 0;
    const double width = ceil(in / r->abreast) * r->abreast;

    switch (f) {
    case FORM_FLOAT:
        return products / r->f32;
    case FORM_WINOGRAD:
        return l->kernel == 3 && l->stride == 1 && whole
                   ? products / r->f32 *
                         (WINOGRAD_SHARE +
                          WINOGRAD_TRANSFORM * (1 / in + 1 / out))
                   : INFINITY;
    case FORM_BF16:
        return r->bf16 > 0 ? width * out * taps / r->bf16 + TO_BF16 * read
                           : INFINITY;
    case FORM_INT8:
        return r->int8 > 0 && whole ? products / r->int8 + TO_INT8 * read
                                    : INFINITY;
    }
    return INFINITY;
}

enum form form_choose(const struct form_layer *l, enum form max,
                      const struct form_rates *r)
{
    enum form best = FORM_FLOAT;

    if (preferred != FORM_FLOAT && preferred <= max &&
        form_cycles(preferred, l, r) < INFINITY)
        return preferred;
    for (int f = FORM_WINOGRAD; f <= (int)max; f++)
        if (form_cycles((enum form)f, l, r) < form_cycles(best, l, r))
            best = (enum form)f;
    return best;
}
