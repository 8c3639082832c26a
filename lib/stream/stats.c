/* Smallest, mean and largest value of an array of any dtype. */
#include "lib/stream/stats.h"

#include <math.h>

#include "lib/base/half.h"

double array_value(const struct array *a, size_t i)
{
    switch (a->dtype) {
    case DTYPE_U8:  return ((const uint8_t *)a->data)[i];
    case DTYPE_I32: return ((const int32_t *)a->data)[i];
    case DTYPE_F16: return half_to_float(((const uint16_t *)a->data)[i]);
    case DTYPE_F32: return ((const float *)a->data)[i];
    case DTYPE_F64: return ((const double *)a->data)[i];
    }
    return NAN;
}

void array_stats(struct array_stats *s, const struct array *a)
{
    const size_t n = array_count(a);
    double min = INFINITY, max = -INFINITY;
    double sum[4] = {0};        /* so that the additions overlap */
    size_t finite = 0;

    for (size_t i = 0; i < n; i++) {
        const double v = array_value(a, i);

        if (!isfinite(v))
            continue;
        min = v < min ? v : min;
        max = v > max ? v : max;
        sum[i % 4] += v;
        finite++;
    }
    s->min = finite ? min : NAN;
    s->max = finite ? max : NAN;
    s->mean = finite ? (sum[0] + sum[1] + sum[2] + sum[3]) / (double)finite
                     : NAN;
    s->nonfinite = n - finite;
}
