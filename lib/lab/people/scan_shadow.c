/* Shadows of the lamps: depth maps seen from each, blurred in the exponential
 * as wide as the lamp is large. */
#include <math.h>
#include <string.h>

#include "lib/lab/people/lens.h"
#include "lib/lab/people/scan_stage.h"
#include "lib/base/vec3.h"

#define REACH 1.3f              /* half the width of what a map covers */
#define SHARP 34.0f

/* What has holes: hair, lashes, veils. */
static const struct bitmap *shadow_picture(const struct figure_part *p)
{
    return p->piece && p->stuff >= STUFF_VEIL ? &p->piece->picture : NULL;
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
    lens_box(w->map, s->flat, SCAN_SHADOW, 1 + (int)(l->size * 18));
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
