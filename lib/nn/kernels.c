/* The tables behind nn_kernels: one per instruction set. */
#include "lib/nn/kernels.h"

static const struct nn_kernels tables[] = {
#define X(type, name, args) .name = name##_baseline,
    [CPU_BASELINE] = { NN_KERNELS(X) .lanes = 4 },
#undef X
#ifdef SPID_X86
#define X(type, name, args) .name = name##_avx2,
    [CPU_AVX2] = { NN_KERNELS(X) .lanes = 8 },
#undef X
#define X(type, name, args) .name = name##_avx512,
    [CPU_AVX512] = { NN_KERNELS(X) .lanes = 16 },
#undef X
#endif
};

const struct nn_kernels *nn_kernels_at(enum cpu_level level)
{
    return &tables[level];
}

const struct nn_kernels *nn_kernels(void)
{
    return nn_kernels_at(cpu_level());
}
