/* Half floats to floats, once per instruction set (half.h). */
#include "lib/base/half.h"

#include <string.h>

#include "lib/base/simd.h"

void ISA(half_widen)(float *out, const void *in, size_t n)
{
    const char *from = in;
    size_t i = 0;

    for (; i + VEC <= n; i += VEC)
        vf_store(out + i, vf_load_half((const void *)(from + 2 * i)));
    if (i < n) {
        uint16_t rest[VEC] = {0};

        memcpy(rest, from + 2 * i, (n - i) * sizeof *rest);
        vf_store_some(out + i, vf_load_half(rest), n - i);
    }
}
