/* Normalisation: sums per channel, and the elementwise passes.  Channel
 * parameters come repeated to a period of at least NORM_PERIOD values. */
#include "lib/nn/kernels.h"
#include "lib/nn/math.h"

#define SHORT 64

/* How many rows of C make a row worth a vector loop. */
static size_t norm_repeat(size_t C)
{
    return C < SHORT ? (SHORT + C - 1) / C : 1;
}

/* Two sums per channel, over long rows of `rep` rows of C when C is short. */
struct norm_long_row {
    size_t rep, length;            /* length = rep * C */
    float *a, *b;                  /* (length) the sums so far */
    const float *origin;           /* (length) per channel, repeated */
    float s1[2 * SHORT], s2[2 * SHORT], k[2 * SHORT];
};

/* sum (2,C) receives the sums in the end; origin (C). */
static void norm_sums_begin(struct norm_long_row *t, float *sum,
                            const float *origin, size_t C)
{
    t->rep = norm_repeat(C);
    t->length = t->rep * C;
    t->a = t->rep > 1 ? t->s1 : sum;
    t->b = t->rep > 1 ? t->s2 : sum + C;
    t->origin = t->rep > 1 ? t->k : origin;
    for (size_t c = 0; c < t->length; c++)
        t->a[c] = t->b[c] = 0;
    for (size_t c = 0; t->rep > 1 && c < t->length; c++)
        t->k[c] = origin[c % C];
}

/* sum (2,C): the long row's values of each channel, added in order. */
static void norm_sums_end(const struct norm_long_row *t, float *sum, size_t C)
{
    for (size_t c = 0; t->rep > 1 && c < C; c++) {
        sum[c] = t->a[c];
        sum[C + c] = t->b[c];
        for (size_t i = 1; i < t->rep; i++) {
            sum[c] += t->a[i * C + c];
            sum[C + c] += t->b[i * C + c];
        }
    }
}

/* sum (2,C) = sums of x - shift and of its square over rows of C. */
void ISA(norm_sums)(float *sum, const float *x, const float *shift,
                    size_t rows, size_t C)
{
    struct norm_long_row t;

    norm_sums_begin(&t, sum, shift, C);
    float *restrict a = t.a, *restrict b = t.b;
    const float *restrict m = t.origin;
    for (size_t r = 0; r < rows; r += t.rep) {
        size_t n = rows - r < t.rep ? (rows - r) * C : t.length;
        const float *restrict p = x + r * C;

        for (size_t c = 0; c < n; c++) {
            float d = p[c] - m[c];

            a[c] += d;
            b[c] += d * d;
        }
    }
    norm_sums_end(&t, sum, C);
}

/* y = act(x scale + shift) (+ res). */
void ISA(norm_apply)(float *y, const float *x, const float *res,
                     const float *scale, const float *shift, int act,
                     size_t period, size_t n)
{
#define LOOP(A)                                                              \
    for (size_t i = 0; i < n; i += period) {                                 \
        size_t m = n - i < period ? n - i : period;                          \
        float *restrict to = y + i;                                          \
        const float *restrict from = x + i;                                  \
        for (size_t c = 0; c < m; c++)                                       \
            to[c] = math_act(from[c] * scale[c] + shift[c], A);              \
    }
    MATH_FOR_ACT(act, LOOP)
#undef LOOP
    if (res)
        for (size_t i = 0; i < n; i++)
            y[i] += res[i];
}

/* dz = dy act'(x scale + shift); sum (2,C) = sums of dz and dz (x - mean).
 * last: then dz is scaled, which is all there is to frozen statistics.  scale
 * and shift are read over one period of norm_repeat(C) rows. */
void ISA(norm_backward_sums)(float *sum, float *dz, const float *dy,
                             const float *x, const float *scale,
                             const float *shift, const float *mean, int act,
                             int last, size_t rows, size_t C)
{
    struct norm_long_row t;

    norm_sums_begin(&t, sum, mean, C);
    size_t rep = t.rep, L = t.length;
    float *restrict a = t.a, *restrict b = t.b;
    const float *restrict m = t.origin;
#define LOOP(A)                                                              \
    for (size_t r = 0; r < rows; r += rep) {                                 \
        size_t n = rows - r < rep ? (rows - r) * C : L;                      \
        const float *restrict p = x + r * C;                                 \
        const float *q = dy + r * C;                                         \
        float *d = dz + r * C;                                               \
        KERNEL_INDEPENDENT                                                   \
        for (size_t c = 0; c < n; c++) {                                     \
            float g = q[c] * math_slope(p[c] * scale[c] + shift[c], A);      \
            d[c] = last ? g * scale[c] : g;                                  \
            a[c] += g;                                                       \
            b[c] += g * (p[c] - m[c]);                                       \
        }                                                                    \
    }
    MATH_FOR_ACT(act, LOOP)
#undef LOOP
    norm_sums_end(&t, sum, C);
}

/* dx = a dz + b (x - m) + c; abcm (4,period). */
void ISA(norm_backward_apply)(float *dx, const float *dz, const float *x,
                              const float *abcm, size_t period, size_t n)
{
    const float *restrict a = abcm, *restrict b = abcm + period;
    const float *restrict k = abcm + 2 * period, *restrict m = k + period;

    for (size_t i = 0; i < n; i += period) {
        size_t len = n - i < period ? n - i : period;
        float *to = dx + i;
        const float *from = dz + i;
        const float *restrict p = x + i;
        KERNEL_INDEPENDENT
        for (size_t c = 0; c < len; c++)
            to[c] = a[c] * from[c] + b[c] * (p[c] - m[c]) + k[c];
    }
}

/* Sum of n values in 16 lanes, folded in a fixed order. */
static inline float norm_lane_sum(const float *lane)
{
    float s = 0;

    for (int i = 0; i < 16; i++)
        s += lane[i];
    return s;
}

/* See norm.h; mean and rstd may be NULL, or w and b. */
void ISA(layer_norm_forward)(float *y, float *mean, float *rstd,
                             const float *x, const float *w, const float *b,
                             float eps, size_t rows, size_t C)
{
    for (size_t r = 0; r < rows; r++) {
        const float *restrict p = x + r * C;
        float *restrict q = y + r * C;
        float s[16] = { 0 }, v[16] = { 0 };

        for (size_t c = 0; c < C; c += 16)
            for (size_t i = 0; i < 16; i++)
                s[i] += c + i < C ? p[c + i] : 0;
        float m = norm_lane_sum(s) / (float)C;
        for (size_t c = 0; c < C; c += 16)
            for (size_t i = 0; i < 16; i++) {
                float d = c + i < C ? p[c + i] - m : 0;

                v[i] += d * d;
            }
        float k = 1 / sqrtf(norm_lane_sum(v) / (float)C + eps);
        for (size_t c = 0; c < C; c++)
            q[c] = w ? (p[c] - m) * k * w[c] + b[c] : (p[c] - m) * k;
        if (mean) {
            mean[r] = m;
            rstd[r] = k;
        }
    }
}

/* dx written; sum (2,C) += dweight and dbias of these rows. */
void ISA(layer_norm_backward)(float *dx, float *sum, const float *dy,
                              const float *x, const float *mean,
                              const float *rstd, const float *w, size_t rows,
                              size_t C)
{
    for (size_t c = 0; c < 2 * C; c++)
        sum[c] = 0;
    for (size_t r = 0; r < rows; r++) {
        const float *restrict p = x + r * C, *g = dy + r * C;
        float *d = dx + r * C, m = mean[r], k = rstd[r];
        float *restrict dw = sum, *restrict db = sum + C;
        float s[16] = { 0 }, t[16] = { 0 };

        for (size_t c = 0; c < C; c += 16)
            for (size_t i = 0; i < 16 && c + i < C; i++) {
                float h = g[c + i] * w[c + i];

                s[i] += h;
                t[i] += h * (p[c + i] - m) * k;
            }
        float s1 = norm_lane_sum(s) / (float)C;
        float s2 = norm_lane_sum(t) / (float)C;
        KERNEL_INDEPENDENT
        for (size_t c = 0; c < C; c++) {
            float hat = (p[c] - m) * k, gy = g[c];

            dw[c] += gy * hat;
            db[c] += gy;
            d[c] = (gy * w[c] - s1 - hat * s2) * k;
        }
    }
}
