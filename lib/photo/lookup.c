/* Lookups in the photograph, tile by tile (texture.h). */
#include "lib/photo/lookup.h"

#include <math.h>
#include <string.h>

#include "lib/base/cpu.h"
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
    float least = INFINITY;
    size_t best = 0;

    for (size_t l = 0; l < t->levels; l++) {
        float away = fabsf(log2f(zoom * (float)t->side[l]) - TEXTURE_FINER);

        if (away < least) {
            least = away;
            best = l;
        }
    }
    return best;
}

/* ---- pixels at the picture's border ---------------------------------------
 */

/* Change of the offset from pixel p to the one `step` further, pixels; 0 where
 * that one has no place. */
static float texture_change(const float *p, long step, float size)
{
    const float *q = p + 3 * step;

    if (!(q[2] > TEXTURE_LEAST))
        return 0;
    float x = q[0] / q[2] - p[0] / p[2], y = q[1] / q[2] - p[1] / p[2];
    return 0.5f * size * sqrtf(x * x + y * y);
}

/* The confidence in pixel (x,y), which has a place. */
static float texture_confidence(const float *place,
                                const struct splat_place_view *v, float zoom,
                                const float *alpha, size_t x, size_t y,
                                size_t size)
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
    float own = TEXTURE_SHARE(share);
    if (!(own > 0 && sure > 0))
        return 0;
    return fminf(own, 1) * fminf(sure, 1) *
           texture_stretch(place, v, zoom, x, y, size);
}

/* ---- tiles ----------------------------------------------------------------
 */

/* A picture's lookups: what is the same for all of its pixels. */
struct lookup {
    const struct texture *t;
    const struct lookup_kernels *kernels;
    const float *place, *alpha;
    size_t level, size, across;         /* tiles from left to right */
    struct texture_rim rim;             /* texture_rim of the view */
    struct lookup_view view;
};

static struct lookup lookup_make(const struct texture *t,
                                 const struct splat_place_view *v,
                                 const float *place, const float *alpha,
                                 size_t size)
{
    const size_t level = texture_level(t, v, size);

    return (struct lookup){
        t, lookup_kernels(), place, alpha, level, size,
        (size + LOOKUP_WIDE - 1) / LOOKUP_WIDE, texture_rim(v),
        {*v, texture_zoom(v), (float)size, 0.5f * (float)t->side[level]}
    };
}

/* Tiles of a picture. */
static size_t lookup_tiles(const struct lookup *k)
{
    return k->across * ((k->size + LOOKUP_HIGH - 1) / LOOKUP_HIGH);
}

/* A tile: n columns from x0 on, m rows from y0 on. */
struct lookup_tile {
    size_t x0, n, y0, m;
};

static struct lookup_tile lookup_tile(const struct lookup *k, size_t i)
{
    struct lookup_tile t = {i % k->across * LOOKUP_WIDE, LOOKUP_WIDE,
                            i / k->across * LOOKUP_HIGH, LOOKUP_HIGH};

    t.n = k->size - t.x0 < t.n ? k->size - t.x0 : t.n;
    t.m = k->size - t.y0 < t.m ? k->size - t.y0 : t.m;
    return t;
}

/* Line `line` of the planes: picture row y about columns x0 .. x0 + n - 1;
 * whether it has a place. */
static bool lookup_fill_line(struct lookup_planes *p, size_t line,
                             const struct lookup *k, size_t x0, size_t n,
                             size_t y)
{
    const size_t left = x0 < LOOKUP_SIDE ? x0 : LOOKUP_SIDE;
    size_t right = k->size - x0, at = LOOKUP_SIDE - left;
    const float *place = k->place + 3 * (y * k->size + x0 - left);
    float rest[3 * 16] = {0};

    right = left + (right < n + LOOKUP_SIDE ? right : n + LOOKUP_SIDE);
    const size_t whole = right / 16 * 16;
    bool some = k->kernels->offsets(p->x[line] + at, p->y[line] + at,
                                    p->w[line] + at, place, whole);
    if (right == whole)
        return some;
    memcpy(rest, place + 3 * whole, 3 * (right - whole) * sizeof *rest);
    at += whole;
    return k->kernels->offsets(p->x[line] + at, p->y[line] + at,
                               p->w[line] + at, rest, 16) || some;
}

/* The planes of a tile; whether it or what is about it has a place. */
static bool lookup_fill(struct lookup_planes *p, const struct lookup *k,
                        const struct lookup_tile *t)
{
    bool some = false;

    for (size_t line = 0; line < t->m + 2 * LOOKUP_ABOVE; line++) {
        size_t y = t->y0 + line - LOOKUP_ABOVE; /* wraps above the picture */

        memset(p->w[line], 0, sizeof p->w[line]);
        if (y < k->size)
            some |= lookup_fill_line(p, line, k, t->x0, t->n, y);
    }
    return some;
}

/* Pixels of a row too near the border for the kernel, one by one. */
static void lookup_confidence_border(struct lookup_row *r,
                                     const struct lookup *k,
                                     const struct lookup_tile *t, size_t y)
{
    const size_t most = k->size - TEXTURE_ACROSS;
    const bool row = y < TEXTURE_ACROSS || y >= most ||
                     k->size < 2 * TEXTURE_ACROSS;

    for (size_t i = 0, x = t->x0; i < t->n; i++, x++)
        if ((row || x < TEXTURE_ACROSS || x >= most) && r->w[i] > 0)
            r->sure[i] = texture_confidence(k->place, &k->view.v, k->view.zoom,
                                            k->alpha, x, y, k->size);
}

/* photo (n,5) of row y of a tile. */
static void lookup_row(float *photo, struct lookup_row *r,
                       const struct lookup *k, const struct lookup_tile *t,
                       const struct lookup_planes *p, size_t y)
{
    const size_t line = y - t->y0 + LOOKUP_ABOVE, S = k->t->side[k->level];

    r->x = p->x[line] + LOOKUP_SIDE;
    r->y = p->y[line] + LOOKUP_SIDE;
    r->w = p->w[line] + LOOKUP_SIDE;
    r->step = 2.0f / (float)k->size;
    r->nx = ((float)t->x0 + 0.5f) * r->step - 1;
    r->ny = ((float)y + 0.5f) * r->step - 1;
    memcpy(r->alpha, k->alpha + y * k->size + t->x0, t->n * sizeof *r->alpha);
    memset(photo, 0, TEXTURE_PHOTO * t->n * sizeof *photo);
    k->kernels->confide(r, &k->view, t->n);
    lookup_confidence_border(r, k, t, y);
    for (size_t i = 0; i < t->n; i++)
        r->inside[i] = k->rim.inner > 0 && r->sure[i] > 0
                     ? texture_inside(k->alpha, t->x0 + i, y, k->size) : 0;
    k->kernels->bicubic(photo, r->u, r->v, r->sure, r->alpha, r->inside,
                        t->n, k->t->level[k->level], S, k->rim);
}

void texture_lookup(float *photo, const struct texture *t,
                    const struct splat_place_view *v, const float *place,
                    const float *alpha, size_t size)
{
    const struct lookup k = lookup_make(t, v, place, alpha, size);

#pragma omp parallel for schedule(dynamic)
    for (size_t i = 0; i < lookup_tiles(&k); i++) {
        const struct lookup_tile tile = lookup_tile(&k, i);
        struct lookup_planes p;
        struct lookup_row r = {0};
        const bool some = lookup_fill(&p, &k, &tile);

        for (size_t y = tile.y0; y < tile.y0 + tile.m; y++) {
            float *to = photo + TEXTURE_PHOTO * (y * size + tile.x0);

            if (some)
                lookup_row(to, &r, &k, &tile, &p, y);
            else
                memset(to, 0, TEXTURE_PHOTO * tile.n * sizeof *to);
        }
    }
}

/* Tile by tile over color (size,size,channels) and alpha, with a field or
 * NULL. */
static void lookup_apply(float *color, size_t channels, float *alpha,
                         const struct lookup *k,
                         const struct texture_field *field, float step)
{
#pragma omp parallel for schedule(dynamic)
    for (size_t i = 0; i < lookup_tiles(k); i++) {
        const struct lookup_tile tile = lookup_tile(k, i);
        float photo[TEXTURE_PHOTO * LOOKUP_WIDE];
        struct lookup_planes p;
        struct lookup_row r = {0};

        if (!lookup_fill(&p, k, &tile))
            continue;
        for (size_t y = tile.y0; y < tile.y0 + tile.m; y++) {
            const size_t at = y * k->size + tile.x0;

            lookup_row(photo, &r, k, &tile, &p, y);
            if (field)
                texture_field_row(photo, field, step, tile.x0, tile.n, y);
            texture_mix(color + channels * at, channels, alpha + at, photo,
                        tile.n);
        }
    }
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
