/* The z-buffer of a figure: what each sample sees, its light, and veils over
 * it from far to near. */
#include <string.h>

#include "lib/base/sort.h"
#include "lib/lab/people/scan_stage.h"
#include "lib/lab/people/tri.h"
#include "lib/base/vec3.h"

/* Into the grid what is nearer than what is there: which face, and where on
 * it. */
static void draw_solid(struct scan_stage *s, uint32_t i)
{
    const int32_t *v = s->figure->faces + 3 * i;
    struct tri t;
    int x0, x1, n = s->grid;

    if (!tri_setup(&t, &s->spot[v[0]], &s->spot[v[1]], &s->spot[v[2]], n, n))
        return;
    for (int y = t.y0; y <= t.y1; y++) {
        if (!tri_row(&t, y, n, &x0, &x1))
            continue;
        float dy = (float)y + 0.5f - t.oy, q0 = t.q[1] * dy + t.q[2];
        for (int x = x0; x <= x1; x++) {
            float dx = (float)x + 0.5f - t.ox, q = q0 + t.q[0] * dx;
            size_t at = (size_t)(y * n + x);
            if (q <= s->q[at])
                continue;
            s->q[at] = q;
            s->id[at] = i;
            s->b1[at] = t.w[0] * dx + t.w[1] * dy;
            s->b2[at] = t.w[2] * dx + t.w[3] * dy;
        }
    }
}

/* What a point of a face, at weights b1 and b2 of its second and third corner,
 * is made of. */
static void scan_draw_gather(struct scan_point *o, const struct scan_stage *s,
                             uint32_t face, float b1, float b2)
{
    const struct figure *f = s->figure;
    const int32_t *v = f->faces + 3 * face;
    float w[3] = {1 - b1 - b2, b1, b2};

    memset(o, 0, sizeof *o);
    o->face = face;
    copy3(o->w, w);
    for (int c = 0; c < 3; c++) {
        size_t i = (size_t)v[c];
        mad3(o->p, o->p, s->place + 3 * i, w[c]);
        mad3(o->n, o->n, s->normal + 3 * i, w[c]);
        mad3(o->bright, o->bright, s->bright + 3 * i, w[c]);
        o->extra += w[c] * f->extra[i];
        o->u += w[c] * f->uv[2 * i];
        o->v += w[c] * f->uv[2 * i + 1];
    }
    unit3(o->n);
    for (int k = 0; k < 3; k++)
        o->view[k] = -o->p[k];
    unit3(o->view);
}

/* Skin turns to what the vertices say it is: lips, nose, ears, neck. */
static uint8_t draw_label_at(const struct scan_stage *s,
                             const struct scan_point *o)
{
    const struct figure *f = s->figure;
    const struct figure_part *p = &f->parts[f->part[o->face]];

    if (p->ride != RIDE_FACE || p->stuff > STUFF_SCALP)
        return p->label;
    int c = o->w[1] > o->w[0] ? 1 : 0;
    c = o->w[2] > o->w[c] ? 2 : c;
    return f->assets->label[f->bind[4 * f->faces[3 * o->face + (size_t)c]]];
}

void scan_draw(struct scan_stage *s)
{
    const struct figure *f = s->figure;
    size_t n = (size_t)s->grid * (size_t)s->grid;
    struct scan_point o;

    memset(s->q, 0, n * sizeof *s->q);
    memset(s->id, 0xff, n * sizeof *s->id);
    for (uint32_t i = 0; i < f->nf; i++)
        if (f->stuff[i] < STUFF_VEIL)
            draw_solid(s, i);
    for (size_t at = 0; at < n; at++) {
        float *c = s->color + 3 * at;
        if (s->id[at] == RASTER_NONE) {
            c[0] = c[1] = c[2] = s->cover[at] = 0;
            s->label[at] = LABEL_NONE;
            continue;
        }
        scan_draw_gather(&o, s, s->id[at], s->b1[at], s->b2[at]);
        scan_shade(c, s, &o);
        s->cover[at] = 1;
        s->label[at] = draw_label_at(s, &o);
    }
}

/* ---- veils -------------------------------------------------------------- */

/* Over what is drawn, what one can see through in part: hair, brows, lashes,
 * beards, lenses; they come sorted from back to front. */
static void draw_veil(struct scan_stage *s, uint32_t i)
{
    const struct figure *f = s->figure;
    const int32_t *v = f->faces + 3 * i;
    struct scan_point o;
    struct tri t;
    int x0, x1, n = s->grid;

    /* brows may sink into the skin a little */
    float slack = 1 - (f->stuff[i] == STUFF_BROW ? 0.018f : 0.004f)
                      * s->spot[v[0]].q;

    if (!tri_setup(&t, &s->spot[v[0]], &s->spot[v[1]], &s->spot[v[2]], n, n))
        return;
    for (int y = t.y0; y <= t.y1; y++) {
        if (!tri_row(&t, y, n, &x0, &x1))
            continue;
        for (int x = x0; x <= x1; x++) {
            float w[3], q = tri_at(w, &t, x, y), rgb[3];
            size_t at = (size_t)(y * n + x);
            if (q < s->q[at] * slack)
                continue;
            scan_draw_gather(&o, s, i, w[1], w[2]);
            float a = scan_shade_veil(rgb, s, &o), *c = s->color + 3 * at;
            if (a <= 0.004f)
                continue;
            for (int k = 0; k < 3; k++)
                c[k] = rgb[k] * a + c[k] * (1 - a);
            s->cover[at] = a + s->cover[at] * (1 - a);
            if (a > 0.4f || s->label[at] == LABEL_NONE)
                s->label[at] = f->parts[f->part[i]].label;
        }
    }
}

void scan_veils(struct scan_stage *s)
{
    const struct figure *f = s->figure;
    size_t n = 0;

    for (uint32_t i = 0; i < f->nf; i++) {
        const int32_t *v = f->faces + 3 * i;
        if (f->stuff[i] < STUFF_VEIL)
            continue;
        float q = (s->spot[v[0]].q + s->spot[v[1]].q + s->spot[v[2]].q);
        if (q > 0)
            s->order[n++] = sort_key(q, i);     /* nearer is larger */
    }
    sort_keys(s->order, n);
    for (size_t k = 0; k < n; k++)
        draw_veil(s, (uint32_t)s->order[k]);
}
