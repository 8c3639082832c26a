#include "lib/base/parallel.h"

#include <assert.h>
#include <omp.h>
#include <stdatomic.h>

#include "lib/base/processors.h"

static atomic_int width;        /* 0: not yet asked for */

void parallel_set_width(int threads)
{
    width = threads;
    parallel_enter();
}

int parallel_width(void)
{
    int none = 0;

    if (!width)
        atomic_compare_exchange_strong(&width, &none, processors_allowed());
    return width;
}

void parallel_enter(void)
{
    omp_set_num_threads(parallel_width());
}

size_t parallel_slot(void)
{
    const int slot = omp_get_thread_num();

    assert(slot < width);
    return (size_t)slot;
}
