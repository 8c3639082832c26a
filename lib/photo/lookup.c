/* Lookups in the photograph, run by run (texture.h). */
#include "lib/photo/lookup.h"

#include <math.h>
#include <string.h>

#include "lib/base/cpu.h"
#include "lib/base/parallel.h"
#include "lib/photo/lookup_kernel.h"

/* Octaves by which a finer level is preferred. */
#define TEXTURE_FINER 0.1f

/* The level whose pixels are nearest to the picture's in size, with a slight
 * preference for finer ones; much finer ones would flicker. */
size_t texture_level(const struct texture *t, const struct splat_place_view *v,
                     size_t size)
{
    const float zoom = sqrtf(fabsf(v->A[0] * v->A[3] - v->A[1] * v->A[2])) /
                       (float)size;
    float min = INFINITY;
    size_t best = 0;

    for (size_t l = 0; l < t->levels; l++) {
        float away = fabsf(log2f(zoom * (float)t->side[l]) - TEXTURE_FINER);

        if (away < min) {
            min = away;
            best = l;
        }
    }
    return best;
}

/* ---- runs of pixels ------------------------------------------------------ */

void texture_shader_init(struct texture_shader *s, const struct texture *t,
                         const struct splat_place_view *v, size_t size,
                         float *photo, size_t channels)
{
    *s = (struct texture_shader){t, texture_level(t, v, size), size, *v,
                                 splat_place_side(v), photo, channels};
}

/* The pixel p (5) where only the grain has a place, (u,v), 0..1 across: black that is
 * mixed in by what is missing to 1, more or less, by as much. */
static void lookup_grain(float *p, const struct texture *t, float u, float v,
                         float much, float alpha)
{
    const size_t S = t->grain_size;
    const float x = u * (float)S - 0.5f, y = v * (float)S - 0.5f;
    const float last = (float)(S - 1);

    if (!(x >= 0 && y >= 0 && x < last && y < last))
        return;
    const float a = x - floorf(x), b = y - floorf(y);
    const uint8_t *at = t->grain + S * (size_t)y + (size_t)x;
    const float top = (1 - a) * at[0] + a * at[1];
    const float bottom = (1 - a) * at[S] + a * at[S + 1];

    p[3] = alpha;
    p[4] = much * (1 - ((1 - b) * top + b * bottom) / 128);
}

/* photo (n,5) of row y's pixels from x on; whether the photograph shows any of
 * them.  Rows end where they end: what is left of a vector is looked up in a
 * copy. */
static bool lookup_run(float *photo, const struct texture_shader *s,
                       const float *place, const float *alpha, size_t x,
                       size_t y, size_t n)
{
    const struct lookup_kernels *kernels = CPU_PICK(lookup_kernels);
    const size_t S = s->t->side[s->level], whole = n / 16 * 16;
    float step = 2.0f / (float)s->size;
    struct lookup_run r;
    float rest[SPLAT_PLACE_CHANNELS * LOOKUP_RUN], cover[LOOKUP_RUN];

    r.step = step;
    r.nx = ((float)x + 0.5f) * step - 1;
    r.ny = ((float)y + 0.5f) * step - 1;
    r.half = 0.5f * (float)S;
    if (whole < n) {
        memset(rest, 0, sizeof rest);
        memset(cover, 0, sizeof cover);
        memcpy(rest, place, SPLAT_PLACE_CHANNELS * n * sizeof *rest);
        memcpy(cover, alpha, n * sizeof *cover);
        place = rest;
        alpha = cover;
    }
    if (!kernels->places(&r, &s->view, &s->side, place, alpha,
                         (n + 15) / 16 * 16))
        return false;
    memset(photo, 0, TEXTURE_PHOTO * n * sizeof *photo);
    kernels->bicubic(photo, &r, n, s->t->level[s->level], S);
    if (s->t->grain && r.grained)
        for (size_t i = 0; i < n; i++)
            if (r.grain[i] > 0 && !(r.confidence[i] > 0))
                lookup_grain(photo + TEXTURE_PHOTO * i, s->t,
                             r.u[i] / (float)S, r.v[i] / (float)S, r.grain[i],
                             alpha[i]);
    return true;
}

void texture_shade(void *ctx, float *color, float *alpha, const float *place,
                   int x, int y, int n)
{
    const struct texture_shader *s = ctx;
    const size_t left = (size_t)x, row = (size_t)y, count = (size_t)n;
    float run[TEXTURE_PHOTO * LOOKUP_RUN];
    float *photo = s->photo ? s->photo + TEXTURE_PHOTO * (row * s->size + left)
                            : run;
    const bool shown = lookup_run(photo, s, place, alpha, left, row, count);

    if (s->photo && !shown)
        memset(photo, 0, TEXTURE_PHOTO * count * sizeof *photo);
    else if (!s->photo && shown)
        texture_mix(color, s->channels, alpha, photo, count);
}

/* One row. */
PARALLEL(texture_lookup_part, y, const struct texture_shader *, s,
         const float *, place, const float *, alpha)
{
    for (size_t x = 0; x < s->size; x += LOOKUP_RUN) {
        const size_t at = y * s->size + x, left = s->size - x;
        const size_t n = left < LOOKUP_RUN ? left : LOOKUP_RUN;
        float *to = s->photo + TEXTURE_PHOTO * at;

        if (!lookup_run(to, s, place + SPLAT_PLACE_CHANNELS * at, alpha + at,
                        x, y, n))
            memset(to, 0, TEXTURE_PHOTO * n * sizeof *to);
    }
}

void texture_lookup(float *photo, const struct texture *t,
                    const struct splat_place_view *v, const float *place,
                    const float *alpha, size_t size)
{
    struct texture_shader s;

    texture_shader_init(&s, t, v, size, photo, 0);
    parallel_each(texture_lookup_part, size, 1, &s, place, alpha);
}

/* One row. */
PARALLEL(lookup_apply_part, y, const struct texture_shader *, s,
         const float *, place, const struct texture_field *, field,
         float *, color, float *, alpha, float, step)
{
    for (size_t x = 0; x < s->size; x += LOOKUP_RUN) {
        const size_t at = y * s->size + x, left = s->size - x;
        const size_t n = left < LOOKUP_RUN ? left : LOOKUP_RUN;
        float photo[TEXTURE_PHOTO * LOOKUP_RUN];

        if (!lookup_run(photo, s, place + SPLAT_PLACE_CHANNELS * at,
                        alpha + at, x, y, n))
            continue;
        if (field)
            texture_field_row(photo, color + 3 * at, alpha + at, field, step,
                              x, n, y);
        texture_mix(color + 3 * at, 3, alpha + at, photo, n);
    }
}

void texture_apply(float *color, float *alpha, const struct texture *t,
                   const struct splat_place_view *v, const float *place,
                   size_t size, const struct texture_field *field, float step)
{
    struct texture_shader s;

    texture_shader_init(&s, t, v, size, NULL, 3);
    parallel_each(lookup_apply_part, size, 1, &s, place, field, color, alpha,
                  step);
    if (field)
        texture_clamp_to_alpha(color, 3, alpha, size * size);
}
