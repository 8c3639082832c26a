/* Kernels on feature images: resizing, feature transforms, concatenation. */
#include "lib/nn/kernels.h"
#include "lib/nn/rescale.h"
#include "lib/nn/vector.h"

/* to = sum_k w[k] rows[k], rows n values long and `stride` apart. */
VEC_INLINE void rescale_weighted(float *restrict to, const float *restrict from,
                                 const float *w, size_t taps, size_t stride,
                                 size_t n)
{
    if (taps == 2) {
        float a = w[0], b = w[1];

        for (size_t i = 0; i < n; i++)
            to[i] = a * from[i] + b * from[stride + i];
        return;
    }
    for (size_t i = 0; i < n; i++)
        to[i] = w[0] * from[i];
    for (size_t k = 1; k < taps; k++)
        for (size_t i = 0; i < n; i++)
            to[i] += w[k] * from[k * stride + i];
}

/* Row o of one image; line is a scratch row. */
void ISA(rescale_line)(float *out, float *line, const float *in,
                       const struct rescale *r, size_t o)
{
    const struct rescale_axis *y = &r->y, *x = &r->x;
    size_t C = r->C, row = x->in * C;

    rescale_weighted(line, in + (size_t)y->first[o] * row,
                     y->weight + o * y->taps, y->taps, row, row);
    if (C % 16 == 0 && x->taps == 2) {
        for (size_t j = 0; j < x->out; j++) {
            const float *p = line + (size_t)x->first[j] * C;

            vf a = vf_set(x->weight[2 * j]);
            vf b = vf_set(x->weight[2 * j + 1]);
            for (size_t c = 0; c < C; c += VEC)
                vf_store(out + j * C + c,
                          a * vf_load(p + c) + b * vf_load(p + C + c));
        }
        return;
    }
    for (size_t j = 0; j < x->out; j++)
        rescale_weighted(out + j * C, line + (size_t)x->first[j] * C,
                         x->weight + j * x->taps, x->taps, C, C);
}

/* Row i of the input's gradient. */
void ISA(rescale_line_backward)(float *din, float *line, const float *dout,
                                const struct rescale *r, size_t i)
{
    const struct rescale_axis *y = &r->y, *x = &r->x;
    size_t C = r->C, row = x->out * C;
    float *restrict t = line;

    for (size_t k = 0; k < row; k++)
        t[k] = 0;
    for (int32_t j = y->start[i]; j < y->start[i + 1]; j++) {
        const float *restrict p = dout + (size_t)y->from[j] * row;
        float w = y->tweight[j];

        for (size_t k = 0; k < row; k++)
            t[k] += w * p[k];
    }
    for (size_t k = 0; k < x->in; k++) {
        float *restrict d = din + k * C;

        for (size_t c = 0; c < C; c++)
            d[c] = 0;
        for (int32_t j = x->start[k]; j < x->start[k + 1]; j++) {
            const float *restrict p = t + (size_t)x->from[j] * C;
            float w = x->tweight[j];

            for (size_t c = 0; c < C; c++)
                d[c] += w * p[c];
        }
    }
}

/* y = x (one + s) + t; st rows hold s (C) then t (C). */
void ISA(sft_forward)(float *y, const float *x, const float *st, float one,
                      size_t rows, size_t C)
{
    for (size_t r = 0; r < rows; r++) {
        const float *p = x + r * C, *s = st + 2 * r * C, *t = s + C;
        float *q = y + r * C;
        KERNEL_INDEPENDENT
        for (size_t c = 0; c < C; c++)
            q[c] = p[c] * (one + s[c]) + t[c];
    }
}

/* dx = dy (one + s); dst = [dy x, dy].  dx may be dy. */
void ISA(sft_backward)(float *dx, float *dst, const float *dy, const float *x,
                       const float *st, float one, size_t rows, size_t C)
{
    for (size_t r = 0; r < rows; r++) {
        const float *p = x + r * C, *s = st + 2 * r * C, *g = dy + r * C;
        float *d = dx + r * C, *ds = dst + 2 * r * C, *dt = ds + C;
        KERNEL_INDEPENDENT
        for (size_t c = 0; c < C; c++) {
            float v = g[c];

            ds[c] = v * p[c];
            dt[c] = v;
            d[c] = v * (one + s[c]);
        }
    }
}

/* y += x */
void ISA(add)(float *y, const float *x, size_t n)
{
    for (size_t i = 0; i < n; i++)
        y[i] += x[i];
}

/* y <- x as bfloat16 */
void ISA(to_bf16)(uint16_t *y, const float *x, size_t n)
{
    size_t i = 0;

    for (; i + VEC <= n; i += VEC)
        vf_store_bf16(y + i, vf_load(x + i));
    if (i < n) {
        uint16_t half[VEC];

        vf_store_bf16(half, vf_load_some(x + i, n - i));
        memcpy(y + i, half, (n - i) * sizeof *y);
    }
}

/* *lo and *hi lowered and raised to what is in x */
void ISA(range)(float *lo, float *hi, const float *x, size_t n)
{
    vf min = vf_set(*lo), max = vf_set(*hi);
    size_t whole = n / VEC * VEC;

    for (size_t i = 0; i < whole; i += VEC) {
        vf v = vf_load(x + i);
        min = vf_min(min, v);
        max = vf_max(max, v);
    }
    for (size_t k = 0; k < VEC; k++) {
        *lo = min[k] < *lo ? min[k] : *lo;
        *hi = max[k] > *hi ? max[k] : *hi;
    }
    for (size_t i = whole; i < n; i++) {
        *lo = x[i] < *lo ? x[i] : *lo;
        *hi = x[i] > *hi ? x[i] : *hi;
    }
}

/* y <- x inverse + zero, which is 0 to 255, to the nearest */
void ISA(quantise)(uint8_t *y, const float *x, float inverse, float zero,
                   size_t n)
{
    size_t whole = n / VEC * VEC;

    for (size_t i = 0; i < whole; i += VEC)
        vf_store_bytes(y + i, vf_load(x + i) * inverse + (zero + 0.5f));
    for (size_t i = whole; i < n; i++) {
        float v = x[i] * inverse + (zero + 0.5f);

        y[i] = (uint8_t)(v < 0 ? 0 : v > 255 ? 255 : v);
    }
}
