/* The loops of map.h. */
#include "tests/reference/map.h"

#include <math.h>
#include <stdlib.h>

struct map map_make(size_t h, size_t w, size_t C)
{
    struct map m = {h, w, C, calloc(h * w * C, sizeof(double))};

    if (!m.v)
        exit(1);
    return m;
}

static size_t map_count(const struct map *x)
{
    return x->h * x->w * x->C;
}

struct map map_of(const float *x, size_t h, size_t w, size_t C)
{
    struct map m = map_make(h, w, C);

    for (size_t i = 0; i < map_count(&m); i++)
        m.v[i] = (double)x[i];
    return m;
}

struct map map_conv(const struct map *x, const float *w, const float *b,
                    size_t out, size_t kernel, size_t stride, size_t pad)
{
    struct map y = map_make((x->h + 2 * pad - kernel) / stride + 1,
                            (x->w + 2 * pad - kernel) / stride + 1, out);
    const size_t taps = kernel * kernel;

    for (size_t i = 0; i < y.h * y.w; i++) {
        double *to = y.v + i * out;

        for (size_t o = 0; o < out; o++)
            to[o] = b ? (double)b[o] : 0;
        for (size_t k = 0; k < taps; k++) {
            const size_t row = i / y.w * stride + k / kernel - pad;
            const size_t col = i % y.w * stride + k % kernel - pad;

            if (row >= x->h || col >= x->w)     /* so are those below 0 */
                continue;
            const double *p = x->v + (row * x->w + col) * x->C;
            for (size_t o = 0; o < out; o++)
                for (size_t c = 0; c < x->C; c++)
                    to[o] += p[c] * (double)w[(o * x->C + c) * taps + k];
        }
    }
    return y;
}

void map_relu(struct map *x)
{
    for (size_t i = 0; i < map_count(x); i++)
        x->v[i] = fmax(x->v[i], 0);
}

struct map map_max_pool(const struct map *x, bool partial)
{
    struct map y = map_make((x->h - 3 + partial) / 2 + 1,
                            (x->w - 3 + partial) / 2 + 1, x->C);

    for (size_t i = 0; i < map_count(&y); i++) {
        const size_t c = i % y.C, u = i / y.C % y.w * 2, v = i / y.C / y.w * 2;

        y.v[i] = -INFINITY;
        for (size_t row = v; row < v + 3 && row < x->h; row++)
            for (size_t col = u; col < u + 3 && col < x->w; col++)
                y.v[i] = fmax(y.v[i], x->v[(row * x->w + col) * x->C + c]);
    }
    return y;
}

void map_put(struct map *to, size_t at, const struct map *x)
{
    for (size_t i = 0; i < map_count(x); i++)
        to->v[i / x->C * to->C + at + i % x->C] = x->v[i];
}

double map_dot(const struct map *x, const float *probe)
{
    double sum = 0;

    for (size_t i = 0; i < map_count(x); i++)
        sum += x->v[i] * (double)probe[i];
    return sum;
}

double map_error(const float *x, const struct map *truth)
{
    double max = 0, size = 1e-30;

    for (size_t i = 0; i < map_count(truth); i++) {
        const double d = fabs((double)x[i] - truth->v[i]);

        max = d <= max ? max : d;           /* a NaN stays */
        size = fmax(size, fabs(truth->v[i]));
    }
    return max / size;
}

double map_gradient_error(const float *d, struct map *x, const float *way,
                          double (*f)(const struct map *x, void *context),
                          void *context)
{
    const double step = 1e-7;
    double along = 0, want = 0, length = 0, size = 0;

    for (size_t i = 0; i < map_count(x); i++) {
        along += (double)d[i] * (double)way[i];
        length += (double)way[i] * (double)way[i];
        size += (double)d[i] * (double)d[i];
    }
    for (int side = -1; side <= 1; side += 2) {
        for (size_t i = 0; i < map_count(x); i++)
            x->v[i] += side * step * (double)way[i];
        want += side * f(x, context) / (2 * step);
        for (size_t i = 0; i < map_count(x); i++)
            x->v[i] -= side * step * (double)way[i];
    }
    return size > 0 ? fabs(want - along) / sqrt(length * size) : INFINITY;
}
