/* The choice among the kernels of shade_tmpl.c. */
#include "lib/lab/people/shade.h"

#include "lib/base/cpu.h"
#include "lib/base/isa.h"

#define DECLARE(isa)                          \
    shade_skin_fn shade_skin_##isa;           \
    shade_eye_fn shade_eye_##isa;             \
    shade_cloth_fn shade_cloth_##isa;         \
    shade_strand_fn shade_strand_##isa;

#define TABLE(isa)                                              \
    { shade_skin_##isa, shade_eye_##isa, shade_cloth_##isa,     \
      shade_strand_##isa }

DECLARE(baseline)
#ifdef SPID_X86
DECLARE(avx2)
DECLARE(avx512)
#endif

const struct shade_kernels *shade_kernels(void)
{
    static const struct shade_kernels tables[] = {
        TABLE(baseline),
#ifdef SPID_X86
        TABLE(avx2),
        TABLE(avx512),
#endif
    };

    return &tables[cpu_level()];
}
