#include "lib/nn/kernels.h"

#include <pthread.h>

#include "lib/base/cpu.h"

static pthread_once_t once = PTHREAD_ONCE_INIT;
static struct nn_kernels table;

static void fill(void)
{
#define X(type, name, args) table.name = name##_baseline;
    NN_KERNELS(X)
#undef X
    table.lanes = 4;
#ifdef SPID_X86
    if (cpu_level() < CPU_AVX2)
        return;
#define X(type, name, args) table.name = name##_avx2;
    NN_KERNELS(X)
#undef X
    table.lanes = 8;
    if (cpu_level() < CPU_AVX512)
        return;
#define X(type, name, args) table.name = name##_avx512;
    NN_KERNELS(X)
#undef X
    table.lanes = 16;
#endif
}

const struct nn_kernels *nn_kernels(void)
{
    pthread_once(&once, fill);
    return &table;
}
