/* Lookups in the photograph, run by run (texture.h). */
#include "lib/photo/lookup.h"

#include <math.h>
#include <string.h>

#include "lib/base/cpu.h"
#include "lib/base/parallel.h"
#include "lib/photo/lookup_kernel.h"

/* Octaves by which a finer level is preferred. */
#define TEXTURE_FINER 0.1f

const struct lookup_kernels *lookup_kernels(void)
{
#ifdef SPID_X86
    if (cpu_level() >= CPU_AVX512)
        return &lookup_kernels_avx512;
    if (cpu_level() >= CPU_AVX2)
        return &lookup_kernels_avx2;
#endif
    return &lookup_kernels_baseline;
}

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

/* ---- runs of pixels ------------------------------------------------------
 */

/* A picture's lookups: what is the same for all of its pixels. */
struct lookup {
    const struct texture *t;
    const struct lookup_kernels *kernels;
    const float *place, *alpha;
    size_t level, size;
    struct splat_place_view view;
};

static struct lookup lookup_make(const struct texture *t,
                                 const struct splat_place_view *v,
                                 const float *place, const float *alpha,
                                 size_t size)
{
    return (struct lookup){t, lookup_kernels(), place, alpha,
                           texture_level(t, v, size), size, *v};
}

/* photo (n,5) of row y's pixels from x0 on; whether the photograph shows any of
 * them.  Rows end where they end: what is left of a vector is looked up in a
 * copy. */
static bool lookup_run(float *photo, const struct lookup *k, size_t x0,
                       size_t n, size_t y)
{
    const size_t S = k->t->side[k->level], at = y * k->size + x0;
    const size_t whole = n / 16 * 16;
    const float *place = k->place + 3 * at, *alpha = k->alpha + at;
    float step = 2.0f / (float)k->size;
    struct lookup_run r = {
        .step = step, .nx = ((float)x0 + 0.5f) * step - 1,
        .ny = ((float)y + 0.5f) * step - 1, .half = 0.5f * (float)S
    };
    float rest[3 * LOOKUP_RUN], cover[LOOKUP_RUN];

    if (whole < n) {
        memset(rest, 0, sizeof rest);
        memset(cover, 0, sizeof cover);
        memcpy(rest, place, 3 * n * sizeof *rest);
        memcpy(cover, alpha, n * sizeof *cover);
        place = rest;
        alpha = cover;
    }
    if (!k->kernels->places(&r, &k->view, place, alpha, (n + 15) / 16 * 16))
        return false;
    memset(photo, 0, TEXTURE_PHOTO * n * sizeof *photo);
    k->kernels->bicubic(photo, r.u, r.v, r.confidence, n, k->t->level[k->level], S);
    return true;
}

/* One row. */
PARALLEL(texture_lookup_part, y, float *, photo, size_t, size, struct lookup, k)
{
    for (size_t x = 0; x < size; x += LOOKUP_RUN) {
        const size_t n = size - x < LOOKUP_RUN ? size - x : LOOKUP_RUN;
        float *to = photo + TEXTURE_PHOTO * (y * size + x);

        if (!lookup_run(to, &k, x, n, y))
            memset(to, 0, TEXTURE_PHOTO * n * sizeof *to);
    }
}

void texture_lookup(float *photo, const struct texture *t,
                    const struct splat_place_view *v, const float *place,
                    const float *alpha, size_t size)
{
    const struct lookup k = lookup_make(t, v, place, alpha, size);

    parallel_each(texture_lookup_part, size, 1, photo, size, k);
}

/* One row. */
PARALLEL(lookup_apply_part, y, const struct lookup *, k,
         const struct texture_field *, field, float *, color, float *, alpha,
         float, step, size_t, channels)
{
    for (size_t x = 0; x < k->size; x += LOOKUP_RUN) {
        const size_t at = y * k->size + x, left = k->size - x;
        const size_t n = left < LOOKUP_RUN ? left : LOOKUP_RUN;
        float photo[TEXTURE_PHOTO * LOOKUP_RUN];

        if (!lookup_run(photo, k, x, n, y))
            continue;
        if (field)
            texture_field_row(photo, field, step, x, n, y);
        texture_mix(color + channels * at, channels, alpha + at, photo, n);
    }
}

/* Run by run over color (size,size,channels) and alpha, with a field or
 * NULL. */
static void lookup_apply(float *color, size_t channels, float *alpha,
                         const struct lookup *k,
                         const struct texture_field *field, float step)
{
    parallel_each(lookup_apply_part, k->size, 1, k, field, color, alpha, step,
                  channels);
}

void texture_apply(float *color, size_t channels, float *alpha,
                   const struct texture *t, const struct splat_place_view *v,
                   const float *place, size_t size)
{
    const struct lookup k = lookup_make(t, v, place, alpha, size);

    lookup_apply(color, channels, alpha, &k, NULL, 0);
}

void texture_apply_field(float *color, float *alpha, const struct texture *t,
                         const struct splat_place_view *v, const float *place,
                         size_t size, const struct texture_field *field,
                         float step)
{
    const struct lookup k = lookup_make(t, v, place, alpha, size);

    lookup_apply(color, 3, alpha, &k, field, step);
    texture_clamp_to_alpha(color, 3, alpha, size * size);
}
