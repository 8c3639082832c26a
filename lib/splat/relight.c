/* A small picture of the light's change: nearest Gaussians of each place, then
 * a blur that also fills what lies between them. */
#include "lib/splat/relight.h"

#include <math.h>
#include <string.h>

#include "lib/base/parallel.h"
#include "lib/base/quad.h"
#include "lib/splat/state.h"

#define CLOSE 0.1f      /* head units behind the foremost of a place and its
                         * neighbours that is still the same surface: such
                         * places are 0.05 across, a face's slope about 2 */
#define SEEN 0.5f       /* opacity from which a Gaussian is a surface */

/* The place of Gaussian i, and its depth; false: it is no surface here. */
static bool relight_place(size_t *at, float *z, const struct splat_state *st,
                          size_t i)
{
    const struct projected_gaussian *p = &st->projection[i];

    if (st->key[i] == HIDDEN || !(p->top > log2f(SEEN)) || !(p->x >= 0) ||
        !(p->y >= 0) || !(p->x < (float)st->view.width) ||
        !(p->y < (float)st->view.height))
        return false;
    memcpy(z, &st->key[i], sizeof *z);
    *at = (size_t)p->y / RELIGHT_STEP * relight_side((size_t)st->view.width) +
          (size_t)p->x / RELIGHT_STEP;
    return true;
}

/* The gain of Gaussian i's colours. */
static float relight_gain(const struct cloud *c, size_t i, const float light[3])
{
    const float n[3] = {c->normal[0][i], c->normal[1][i], c->normal[2][i]};

    return sqrtf(gaussian_light(n, light) * c->lit[i]);
}

/* to (n) of the n numbers at x and at four more places after it, each `step` on
 * from the last: along a line, or of a line and its neighbours. */
typedef void relight_five_fn(float *to, const float *x, size_t step, size_t n);

/* [1 4 6 4 1]/16 */
static void relight_blur(float *to, const float *x, size_t step, size_t n)
{
#pragma omp simd
    for (size_t i = 0; i < n; i++)
        to[i] = (x[i] + x[i + 4 * step] + 4 * (x[i + step] + x[i + 3 * step]) +
                 6 * x[i + 2 * step]) / 16;
}

static inline float relight_less(float a, float b)
{
    return a < b ? a : b;
}

static void relight_min(float *to, const float *x, size_t step, size_t n)
{
#pragma omp simd
    for (size_t i = 0; i < n; i++)
        to[i] = relight_less(relight_less(relight_less(x[i], x[i + step]),
                                          relight_less(x[i + 2 * step],
                                                       x[i + 3 * step])),
                             x[i + 4 * step]);
}

/* x (h,w) along its lines, then across them; beyond its edges lies `beyond`.
 * room: (h + 5) (w + 4). */
static void relight_filter(float *x, relight_five_fn *five, float beyond,
                           size_t h, size_t w, float *room)
{
    float *line = room + (h + 4) * w;

    for (size_t i = 0; i < (h + 5) * (w + 4); i++)
        room[i] = beyond;
    for (size_t y = 0; y < h; y++) {
        memcpy(line + 2, x + y * w, w * sizeof *x);
        five(room + (y + 2) * w, line, 1, w);
    }
    for (size_t y = 0; y < h; y++)
        five(x + y * w, room + y * w, w, w);
}

void splat_relight(float *gain, float tint[3], struct splat *s,
                   const float light[LAMP_SIZE])
{
    struct splat_state *st = s->state;
    const size_t h = relight_side((size_t)s->opt.height);
    const size_t w = relight_side((size_t)s->opt.width), places = h * w;
    float *near = st->gain_room, *weight = near + places;
    float *room = weight + places;
    size_t at;
    float z;

    for (int c = 0; c < 3; c++)
        tint[c] = sqrtf(light[3 + c]);
    for (size_t k = 0; k < places; k++) {
        near[k] = INFINITY;
        gain[k] = weight[k] = 0;
    }
    for (size_t i = 0; i < s->n; i++)
        if (relight_place(&at, &z, st, i))
            near[at] = relight_less(z, near[at]);
    relight_filter(near, relight_min, INFINITY, h, w, room);
    for (size_t i = 0; i < s->n; i++)
        if (relight_place(&at, &z, st, i) && z <= near[at] + CLOSE) {
            gain[at] += relight_gain(&st->cloud, i, light);
            weight[at] += 1;
        }
    relight_filter(gain, relight_blur, 0, h, w, room);
    relight_filter(weight, relight_blur, 0, h, w, room);
    for (size_t k = 0; k < places; k++)
        gain[k] = weight[k] > 0 ? gain[k] / weight[k] : 1;
}

/* n pixels times tint and gain, which rises by `rise` from each to the next, at most
 * alpha (NULL: anything): fminf is a call. */
static void relight_pixels(float *color, size_t channels, const float *alpha,
                           const float tint[3], float gain, float rise,
                           size_t n)
{
    for (size_t x = 0; x < n; x++, color += channels, gain += rise) {
        const float max = alpha ? alpha[x] : INFINITY;

        for (int c = 0; max > 0 && c < 3; c++)
            color[c] = relight_less(color[c] * gain * tint[c], max);
    }
}

/* A number of each of four pixels, for each of their three channels in order. */
#define RELIGHT_SPREAD(x) {__builtin_shufflevector(x, x, 0, 0, 0, 1), \
                           __builtin_shufflevector(x, x, 1, 1, 2, 2), \
                           __builtin_shufflevector(x, x, 2, 3, 3, 3)}

/* Four pixels of three channels, all of which have coverage. */
static void relight_four(float *color, quad alpha, const float t[3], quad g)
{
    typedef int32_t mask __attribute__((vector_size(16)));
    const quad gain[3] = RELIGHT_SPREAD(g), max[3] = RELIGHT_SPREAD(alpha);
    const quad tint[3] = {{t[0], t[1], t[2], t[0]}, {t[1], t[2], t[0], t[1]},
                          {t[2], t[0], t[1], t[2]}};

#pragma GCC unroll 3
    for (int k = 0; k < 3; k++) {
        const quad c = *(quad *)(color + 4 * k) * gain[k] * tint[k];
        const mask less = c < max[k];

        *(quad *)(color + 4 * k) = (quad)((less & (mask)c) |
                                          (~less & (mask)max[k]));
    }
}

/* A run, four pixels at once where that can be. */
static void relight_run(float *color, size_t channels, const float *alpha,
                        const float tint[3], float gain, float rise, size_t n)
{
    for (; channels == 3 && alpha && n >= 4 && alpha[0] > 0 && alpha[1] > 0 &&
               alpha[2] > 0 && alpha[3] > 0;
         n -= 4, color += 12, alpha += 4) {
        const float second = gain + rise, third = second + rise;
        const float fourth = third + rise;

        relight_four(color, *(const quad *)alpha, tint,
                     (quad){gain, second, third, fourth});
        gain = fourth + rise;
    }
    relight_pixels(color, channels, alpha, tint, gain, rise, n);
}

/* A row, from the middle of one number to that of the next at a time. */
PARALLEL(relight_apply_part, y, float *, color, size_t, channels,
         const float *, alpha, const float *, gain, const float *, tint, size_t,
         from, size_t, height, size_t, width)
{
    const size_t n = relight_side(from);
    const float step = (float)(RELIGHT_STEP * width) / (float)from;
    const float at = fmaxf(((float)y + 0.5f) * (float)from /
                           (float)(RELIGHT_STEP * height) - 0.5f, 0);
    const size_t low = (size_t)fminf(at, (float)(n - 1));
    const float *up = gain + low * n, *down = up + (low + 1 < n ? n : 0);
    const float v = at - (float)low, last = (float)width;
    const float *cover = alpha ? alpha + y * width : NULL;
    size_t left = 0, right = width;

    while (cover && left < right && !(cover[left] > 0))
        left++;
    while (cover && left < right && !(cover[right - 1] > 0))
        right--;
    for (size_t k = 0, x = 0, next; x < right; k++, x = next) {
        const float end = ((float)(int32_t)k + 0.5f) * step - 0.5f;
        const int32_t before = (int32_t)end;

        next = k < n && end < last
                   ? (size_t)(before + ((float)before < end)) : width;
        if (next <= left)
            continue;
        const size_t a = k ? k - 1 : 0, b = k < n ? k : n - 1;
        const float p = up[a] + v * (down[a] - up[a]);
        const float q = up[b] + v * (down[b] - up[b]);
        const float first = ((float)(int32_t)x + 0.5f) / step + 0.5f -
                            (float)(int32_t)k;

        relight_run(color + channels * (y * width + x), channels,
                    cover ? cover + x : NULL, tint, p + first * (q - p),
                    (q - p) / step, next - x);
    }
}

void relight_apply(float *color, size_t channels, const float *alpha,
                   const float *gain, const float *tint, size_t from,
                   size_t height, size_t width)
{
    static const float none[3] = {1, 1, 1};

    parallel_each(relight_apply_part, height, 1, color, channels, alpha, gain,
                  tint ? tint : none, from, height, width);
}

void relight_apply_backward(float *dcolor, float *dalpha, const float *color,
                            size_t channels, const float *alpha,
                            const float *gain, size_t from)
{
    for (size_t i = 0; i < from * from; i++)
        for (size_t c = channels * i; c < channels * i + 3; c++)
            if (alpha[i] > 0 && color[c] >= alpha[i]) {
                dalpha[i] += dcolor[c];
                dcolor[c] = 0;
            }
    relight_apply(dcolor, channels, NULL, gain, NULL, from, from, from);
}
