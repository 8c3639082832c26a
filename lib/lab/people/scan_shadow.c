/* Shadows of the lamps: depth maps seen from each, blurred in the exponential
 * as wide as the lamp is large. */
#include <math.h>
#include <string.h>

#include "lib/lab/people/scan_stage.h"
#include "lib/base/vec3.h"

#define REACH 1.3f              /* half the width of what a map covers */
#define SHARP 34.0f

/* What has holes: hair, lashes, veils. */
static const struct bitmap *shadow_picture(const struct figure_part *p)
{
    return p->piece && p->stuff >= STUFF_VEIL ? &p->piece->picture : NULL;
}

/* Row a of a map, or the nearest that there is. */
static const float *shadow_row(const float *map, int a)
{
    return map + (a < 0 ? 0 : a < SCAN_SHADOW ? a : SCAN_SHADOW - 1)
                     * SCAN_SHADOW;
}

/* The mean of 2 r + 1 rows; the sums of all columns go down side by side. */
static void shadow_blur_down(float *out, const float *in, int r)
{
    float sum[SCAN_SHADOW] = {0}, w = 1 / (float)(2 * r + 1);

    for (int i = -r; i <= r; i++)
        for (int j = 0; j < SCAN_SHADOW; j++)
            sum[j] += shadow_row(in, i)[j];
    for (int i = 0; i < SCAN_SHADOW; i++) {
        const float *next = shadow_row(in, i + r + 1);
        const float *last = shadow_row(in, i - r);

        for (int j = 0; j < SCAN_SHADOW; j++) {
            out[i * SCAN_SHADOW + j] = sum[j] * w;
            sum[j] += next[j] - last[j];
        }
    }
}

/* Rows become columns. */
static void shadow_turn(float *out, const float *in)
{
    enum { N = SCAN_SHADOW, TILE = 16 };

    for (int t = 0; t < N * N / TILE; t += TILE)
        for (int y = t / N * TILE; y < t / N * TILE + TILE; y++)
            for (int x = t % N; x < t % N + TILE; x++)
                out[x * N + y] = in[y * N + x];
}

/* A box of 2 r + 1 texels, twice along each axis. */
static void shadow_blur(float *map, float *tmp, int r)
{
    for (int axis = 0; axis < 2; axis++) {      /* across, then down */
        shadow_turn(tmp, map);
        shadow_blur_down(map, tmp, r);
        shadow_blur_down(tmp, map, r);
        memcpy(map, tmp, SCAN_SHADOW * SCAN_SHADOW * sizeof *map);
    }
}

/* An orthographic map about the head, then blurred as wide as the lamp is. */
static void shadow_make(struct scan_stage *s, struct scan_shadow *w,
                        const struct lamp *l)
{
    const struct figure *f = s->figure;
    size_t n = (size_t)SCAN_SHADOW * SCAN_SHADOW;

    sun_aim(&w->sun, l->dir, -1, SCAN_SHADOW, REACH);
    sun_centre(&w->sun, s->place, f->parts[0].c1, 64);
    for (size_t i = 0; i < f->nc; i++)
        s->sun[i] = sun_place(&w->sun, s->place + 3 * i);
    memset(w->map, 0, n * sizeof *w->map);
    for (size_t i = 0; i < f->nf; i++) {
        enum stuff k = (enum stuff)f->stuff[i];
        if (k == STUFF_BROW || k == STUFF_LASH || k == STUFF_TEAR
            || k == STUFF_GLASS || k == STUFF_TEETH || k == STUFF_GUM)
            continue;
        sun_draw(w->map, SCAN_SHADOW, s->sun, f->faces + 3 * i, 1, f->uv,
                 shadow_picture(&f->parts[f->part[i]]));
    }
    for (size_t i = 0; i < n; i++) {
        float h = w->map[i] > 0 ? w->map[i] - SUN_FAR : -2;
        w->map[i] = expf(SHARP * clampf(h, -2, 2));
    }
    shadow_blur(w->map, s->flat, 1 + (int)(l->size * 18));
}

void scan_shadows(struct scan_stage *s)
{
    for (int i = 0; i < s->figure->light.nlamp; i++)
        shadow_make(s, &s->shadow[i], &s->figure->light.lamp[i]);
}

float scan_shadow_at(const struct scan_stage *s, int i, const float p[3],
                     const float n[3])
{
    const struct scan_shadow *w = &s->shadow[i];
    float at[3];

    mad3(at, p, n, 0.012f);
    struct raster_vertex v = sun_place(&w->sun, at);
    float x = v.x - 0.5f, y = v.y - 0.5f;
    int x0 = (int)x, y0 = (int)y, m = SCAN_SHADOW;
    if (x < 0 || y < 0 || x0 >= m - 1 || y0 >= m - 1)
        return 1;
    float fx = x - (float)x0, fy = y - (float)y0;
    const float *q = w->map + y0 * m + x0;
    float mean = lerpf(lerpf(q[0], q[1], fx), lerpf(q[m], q[m + 1], fx), fy);
    float lit = expf(SHARP * clampf(v.q - SUN_FAR + 0.006f, -2, 2)) / mean;

    return lit >= 1 ? 1 : clampf((lit - 0.08f) / 0.92f, 0, 1);
}
