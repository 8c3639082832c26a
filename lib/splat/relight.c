/* A small picture of the light's change: nearest Gaussians of each place, then
 * a blur that also fills what lies between them. */
#include "lib/splat/relight.h"

#include <math.h>
#include <string.h>

#include "lib/base/parallel.h"
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

/* What a line becomes, n numbers `step` apart; to: n, close. */
typedef void relight_line_fn(float *to, const float *x, size_t n, size_t step);

/* [1 4 6 4 1]/16, zeros beyond. */
static void relight_blur(float *to, const float *x, size_t n, size_t step)
{
    for (size_t i = 0; i < n; i++) {
        float sum = 6 * x[i * step];

        sum += 4 * ((i > 0 ? x[(i - 1) * step] : 0) +
                    (i + 1 < n ? x[(i + 1) * step] : 0));
        sum += (i > 1 ? x[(i - 2) * step] : 0) +
               (i + 2 < n ? x[(i + 2) * step] : 0);
        to[i] = sum / 16;
    }
}

/* The smallest of five. */
static void relight_min(float *to, const float *x, size_t n, size_t step)
{
    for (size_t i = 0; i < n; i++) {
        const size_t last = i + 2 < n ? i + 2 : n - 1;

        to[i] = x[i * step];
        for (size_t k = i > 2 ? i - 2 : 0; k <= last; k++)
            to[i] = x[k * step] < to[i] ? x[k * step] : to[i];
    }
}

/* x (h,w) by rows, then by columns; tmp: the longer side. */
static void relight_filter(float *x, relight_line_fn *line, size_t h, size_t w,
                         float *tmp)
{
    for (size_t y = 0; y < h; y++) {
        line(tmp, x + y * w, w, 1);
        memcpy(x + y * w, tmp, w * sizeof *x);
    }
    for (size_t k = 0; k < w; k++) {
        line(tmp, x + k, h, w);
        for (size_t y = 0; y < h; y++)
            x[y * w + k] = tmp[y];
    }
}

void splat_relight(float *gain, struct splat *s, const float light[3])
{
    struct splat_state *st = s->state;
    const size_t h = relight_side((size_t)s->opt.height);
    const size_t w = relight_side((size_t)s->opt.width), places = h * w;
    float *near = st->gain_room, *weight = near + places, *tmp = weight + places;
    size_t at;
    float z;

    for (size_t k = 0; k < places; k++) {
        near[k] = INFINITY;
        gain[k] = weight[k] = 0;
    }
    for (size_t i = 0; i < s->n; i++)
        if (relight_place(&at, &z, st, i))
            near[at] = fminf(near[at], z);
    relight_filter(near, relight_min, h, w, tmp);
    for (size_t i = 0; i < s->n; i++)
        if (relight_place(&at, &z, st, i) && z <= near[at] + CLOSE) {
            gain[at] += relight_gain(&st->cloud, i, light);
            weight[at] += 1;
        }
    relight_filter(gain, relight_blur, h, w, tmp);
    relight_filter(weight, relight_blur, h, w, tmp);
    for (size_t k = 0; k < places; k++)
        gain[k] = weight[k] > 0 ? gain[k] / weight[k] : 1;
}

/* Pixel x of `of` between two of n places. */
static inline float relight_tap(size_t *a, size_t *b, size_t x, float by,
                              size_t n)
{
    const float at = ((float)x + 0.5f) * by - 0.5f, low = floorf(at);

    *a = low > 0 ? (size_t)low : 0;
    *b = *a + 1 < n ? (size_t)(low + 1) : n - 1;
    return at - low;
}

PARALLEL(relight_apply_part, y, float *, color, size_t, channels,
         const float *, alpha, const float *, gain, size_t, from, size_t,
         height, size_t, width)
{
    const size_t n = relight_side(from);
    const float by = (float)from / (float)(RELIGHT_STEP * width);
    size_t a, b;
    const float v = relight_tap(&a, &b, y, (float)from /
                              (float)(RELIGHT_STEP * height), n);
    const float *up = gain + a * n, *down = gain + b * n;

    for (size_t x = 0; x < width; x++) {
        float *to = color + channels * (y * width + x);
        const float max = alpha ? alpha[y * width + x] : 1;

        if (!(max > 0))
            continue;
        const float u = relight_tap(&a, &b, x, by, n);
        const float p = up[a] + u * (up[b] - up[a]);
        const float q = down[a] + u * (down[b] - down[a]);

        for (int c = 0; c < 3; c++)
            to[c] = fminf(to[c] * (p + v * (q - p)), max);
    }
}

void relight_apply(float *color, size_t channels, const float *alpha,
                 const float *gain, size_t from, size_t height, size_t width)
{
    parallel_each(relight_apply_part, height, 1, color, channels, alpha, gain,
                  from, height, width);
}
