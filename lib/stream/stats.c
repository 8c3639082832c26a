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

struct sums {
    double min, max, sum;
    size_t finite;
};

/* Four partial sums, so that the additions overlap; rows of 4 elements. */
#define DEFINE_SUM(name, type, value)                                       \
    static void name(struct sums *out, const void *data, size_t n)          \
    {                                                                       \
        const type *x = data;                                               \
        double lo[4], hi[4], sum[4] = { 0 };                                \
        size_t count[4] = { 0 };                                            \
                                                                            \
        for (int k = 0; k < 4; k++) {                                       \
            lo[k] = INFINITY;                                               \
            hi[k] = -INFINITY;                                              \
        }                                                                   \
        for (size_t i = 0; i < n; i++) {                                    \
            double v = value(x[i]);                                         \
            int k = i & 3;                                                  \
                                                                            \
            if (!(fabs(v) <= 1.7976931348623157e308))                       \
                continue;                                                   \
            lo[k] = v < lo[k] ? v : lo[k];                                  \
            hi[k] = v > hi[k] ? v : hi[k];                                  \
            sum[k] += v;                                                    \
            count[k]++;                                                     \
        }                                                                   \
        for (int k = 0; k < 4; k++) {                                       \
            out->min = lo[k] < out->min ? lo[k] : out->min;                 \
            out->max = hi[k] > out->max ? hi[k] : out->max;                 \
            out->sum += sum[k];                                             \
            out->finite += count[k];                                        \
        }                                                                   \
    }

DEFINE_SUM(sum_u8, uint8_t, (double))
DEFINE_SUM(sum_i32, int32_t, (double))
DEFINE_SUM(sum_f16, uint16_t, (double)half_to_float)
DEFINE_SUM(sum_f32, float, (double))
DEFINE_SUM(sum_f64, double, (double))

void array_stats(struct array_stats *s, const struct array *a)
{
    struct sums t = { INFINITY, -INFINITY, 0, 0 };
    size_t n = array_count(a);

    switch (a->dtype) {
    case DTYPE_U8:  sum_u8(&t, a->data, n); break;
    case DTYPE_I32: sum_i32(&t, a->data, n); break;
    case DTYPE_F16: sum_f16(&t, a->data, n); break;
    case DTYPE_F32: sum_f32(&t, a->data, n); break;
    case DTYPE_F64: sum_f64(&t, a->data, n); break;
    }
    s->min = t.finite ? t.min : NAN;
    s->max = t.finite ? t.max : NAN;
    s->mean = t.finite ? t.sum / (double)t.finite : NAN;
    s->nonfinite = n - t.finite;
}
