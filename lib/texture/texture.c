/* The photograph as texture (texture.h): the person cut out of the source
 * picture in several sizes, looked up at blended places. */
#include "lib/texture/texture.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/cpu.h"
#include "lib/texture/lookup_kernel.h"

/* Below this blended weight there is no place to speak of. */
#define TEXTURE_LEAST 0.004f
/* How a place may change from pixel to pixel, beside the view's own change,
 * before it is doubted, and when it is not believed at all. */
#define TEXTURE_JUMP 1.5f
#define TEXTURE_LEAP 3.0f

/* ---- the person alone -------------------------------------------------- */

/* person = rgb - (1 - matte) back, no more than the matte allows. */
static void texture_cut(uint8_t *out, const uint8_t *rgb,
                        const uint8_t *matte, const uint8_t *back, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        int m = matte[i];

        for (size_t c = 0; c < 3; c++) {
            int hidden = ((255 - m) * back[3 * i + c] + 127) / 255;
            int own = rgb[3 * i + c] - hidden;

            out[4 * i + c] = (uint8_t)(own < 0 ? 0 : own > m ? m : own);
        }
        out[4 * i + 3] = (uint8_t)m;
    }
}

void texture_straight(uint8_t *out, const uint8_t *rgb, const uint8_t *matte,
                      const uint8_t *back, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        uint8_t own[4];

        texture_cut(own, rgb + 3 * i, matte + i, back + 3 * i, 1);
        for (size_t c = 0; c < 3; c++)
            out[3 * i + c] = matte[i] ? (uint8_t)(255 * own[c] / matte[i])
                                      : rgb[3 * i + c];
    }
}

/* out (s,s,4) = means of two by two pixels of in (2s or 2s+1 wide). */
static void texture_halve(uint8_t *out, const uint8_t *in, size_t s,
                          size_t width)
{
    for (size_t y = 0; y < s; y++)
        for (size_t x = 0; x < 4 * s; x++) {
            const uint8_t *p = in + 8 * y * width + 2 * (x & ~(size_t)3) +
                               (x & 3);

            out[4 * s * y + x] = (uint8_t)((p[0] + p[4] + p[4 * width] +
                                            p[4 * width + 4] + 2) / 4);
        }
}

int texture_init(struct texture *t, const uint8_t *rgb, const uint8_t *matte,
                 const uint8_t *back, size_t S, struct error *err)
{
    size_t bytes = 0;

    memset(t, 0, sizeof *t);
    t->size = S;
    while (t->levels < TEXTURE_LEVELS && S >> t->levels >= 2) {
        bytes += 4 * (S >> t->levels) * (S >> t->levels);
        t->levels++;
    }
    t->block = malloc(bytes);
    if (!t->block)
        return error_set(err, EX_OSERR, "no memory for a texture of %zu "
                         "pixels", S);
    uint8_t *at = t->block;
    for (size_t l = 0; l < t->levels; l++) {
        t->level[l] = at;
        at += 4 * (S >> l) * (S >> l);
    }
    texture_cut(t->level[0], rgb, matte, back, S * S);
    for (size_t l = 1; l < t->levels; l++)
        texture_halve(t->level[l], t->level[l - 1], S >> l, S >> (l - 1));
    return 0;
}

void texture_release(struct texture *t)
{
    free(t->block);
    memset(t, 0, sizeof *t);
}

/* ---- confidence -------------------------------------------------------- */

/* How much the offset changes from this pixel to the one `step` further, in
 * units of the step; 0 where one of the two has no place. */
static float texture_change(const float *p, long step, float size)
{
    const float *q = p + 3 * step;

    if (!(q[2] > TEXTURE_LEAST))
        return 0;
    float x = q[0] / q[2] - p[0] / p[2], y = q[1] / q[2] - p[1] / p[2];
    return 0.5f * size * sqrtf(x * x + y * y);
}

/* How far pixel (x,y) is to be believed. */
static float texture_confidence(const float *place, const float *alpha,
                                size_t x, size_t y, size_t size)
{
    const float *p = place + 3 * (y * size + x);
    float share = p[2] / fmaxf(alpha[y * size + x], TEXTURE_LEAST);
    float jump = 0, n = (float)size;
    long row = (long)size;

    if (x > 0)
        jump = fmaxf(jump, texture_change(p, -1, n));
    if (x + 1 < size)
        jump = fmaxf(jump, texture_change(p, 1, n));
    if (y > 0)
        jump = fmaxf(jump, texture_change(p, -row, n));
    if (y + 1 < size)
        jump = fmaxf(jump, texture_change(p, row, n));
    float sure = (TEXTURE_LEAP - jump) / (TEXTURE_LEAP - TEXTURE_JUMP);
    float own = 1.25f * share - 0.15f;
    return fminf(fmaxf(own, 0), 1) * fminf(fmaxf(sure, 0), 1);
}

/* ---- lookup ------------------------------------------------------------ */

static texture_bicubic_fn *texture_bicubic(void)
{
#ifdef SPID_X86
    if (cpu_level() >= CPU_AVX512)
        return texture_bicubic_avx512;
    if (cpu_level() >= CPU_AVX2)
        return texture_bicubic_avx2;
#endif
    return texture_bicubic_baseline;
}

/* The level whose pixels are no smaller than three quarters of the picture's:
 * one that is much finer would flicker. */
static size_t texture_level(const struct texture *t,
                            const struct splat_place_view *v, size_t size)
{
    float step = sqrtf(fabsf(v->A[0] * v->A[3] - v->A[1] * v->A[2])) *
                 (float)t->size / (float)size;
    size_t l = 0;

    while (l + 1 < t->levels && step > 1.6f) {
        step *= 0.5f;
        l++;
    }
    return l;
}

#define TEXTURE_RUN 64          /* pixels looked up at once */

/* A picture's lookups: what is the same for all of its pixels. */
struct lookup {
    const struct texture *t;
    const struct splat_place_view *v;
    const float *place, *alpha;
    texture_bicubic_fn *bicubic;
    size_t level, size;
};

static struct lookup lookup_make(const struct texture *t,
                                 const struct splat_place_view *v,
                                 const float *place, const float *alpha,
                                 size_t size)
{
    return (struct lookup){t, v, place, alpha, texture_bicubic(),
                           texture_level(t, v, size), size};
}

/* photo (n,5) of pixels x0 .. x0 + n - 1 of row y, n at most TEXTURE_RUN. */
static void lookup_run(float *photo, const struct lookup *k, size_t x0,
                       size_t n, size_t y)
{
    const float step = 2.0f / (float)k->size;
    const float ny = ((float)y + 0.5f) * step - 1;
    const float *A = k->v->A, *b = k->v->b;
    size_t S = k->t->size >> k->level, any = 0;
    float uv[2 * TEXTURE_RUN], sure[TEXTURE_RUN], half = 0.5f * (float)S;

    memset(photo, 0, TEXTURE_PHOTO * n * sizeof *photo);
    for (size_t i = 0; i < n; i++) {
        const float *p = k->place + 3 * (y * k->size + x0 + i);
        float nx = ((float)(x0 + i) + 0.5f) * step - 1;

        sure[i] = 0;
        if (!(p[2] > TEXTURE_LEAST))
            continue;
        sure[i] = texture_confidence(k->place, k->alpha, x0 + i, y, k->size);
        any += sure[i] > 0;
        uv[2 * i] = half * (A[0] * nx + A[1] * ny + b[0] + p[0] / p[2] + 1);
        uv[2 * i + 1] = half * (A[2] * nx + A[3] * ny + b[1] + p[1] / p[2] +
                                1);
    }
    if (!any)
        return;
    k->bicubic(photo, TEXTURE_PHOTO, uv, sure, n, k->t->level[k->level], S);
    for (size_t i = 0; i < n; i++)
        photo[TEXTURE_PHOTO * i + 4] = sure[i];
}

void texture_lookup(float *photo, const struct texture *t,
                    const struct splat_place_view *v, const float *place,
                    const float *alpha, size_t size)
{
    const struct lookup k = lookup_make(t, v, place, alpha, size);

#pragma omp parallel for schedule(dynamic, 8)
    for (size_t y = 0; y < size; y++)
        for (size_t x = 0; x < size; x += TEXTURE_RUN) {
            size_t n = size - x < TEXTURE_RUN ? size - x : TEXTURE_RUN;

            lookup_run(photo + TEXTURE_PHOTO * (y * size + x), &k, x, n, y);
        }
}

void texture_mix(float *color, size_t channels, float *alpha,
                 const float *photo, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        const float *p = photo + TEXTURE_PHOTO * i;

        if (p[4] == 0)
            continue;
        for (size_t c = 0; c < 3; c++)
            color[channels * i + c] +=
                p[4] * (p[c] - color[channels * i + c]);
        alpha[i] += p[4] * (p[3] - alpha[i]);
    }
}

void texture_apply(float *color, size_t channels, float *alpha,
                   const struct texture *t, const struct splat_place_view *v,
                   const float *place, size_t size)
{
    const struct lookup k = lookup_make(t, v, place, alpha, size);

#pragma omp parallel for schedule(dynamic, 8)
    for (size_t y = 0; y < size; y++)
        for (size_t x = 0; x < size; x += TEXTURE_RUN) {
            size_t n = size - x < TEXTURE_RUN ? size - x : TEXTURE_RUN;
            size_t at = y * size + x;
            float photo[TEXTURE_PHOTO * TEXTURE_RUN];

            lookup_run(photo, &k, x, n, y);
            texture_mix(color + channels * at, channels, alpha + at, photo, n);
        }
}
