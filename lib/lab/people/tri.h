/* A triangle on a grid of samples: rows of it, and planes for 1/z and for the
 * weights of its second and third corner. */
#ifndef SPID_LAB_PEOPLE_TRI_H
#define SPID_LAB_PEOPLE_TRI_H

#include <stdbool.h>

#include "lib/base/vec3.h"

/* A vertex on the sample grid: x, y in samples (the centre of sample i is
 * i + 0.5), q = 1/z with z the camera depth; q <= 0 is behind the camera. */
struct raster_vertex {
    float x, y, q;
};

#define RASTER_NONE 0xffffffffu /* a sample of no face */

struct tri {
    int y0, y1;
    float ox, oy;               /* the first corner */
    float q[3];                 /* q = q[0] dx + q[1] dy + q[2] */
    float w[4];                 /* b1 = w[0] dx + w[1] dy, b2 = w[2] .. */
    float a[3], b[3], c[3];     /* edges, >= 0 inside */
    float xmin, xmax;
};

/* Set t up for a grid of w x h; false when nothing of it is on the grid, a
 * corner lies behind the camera, or it has no area.  Corners may run either
 * way round. */
static inline bool tri_setup(struct tri *t, const struct raster_vertex *a,
                             const struct raster_vertex *b,
                             const struct raster_vertex *c, int w, int h)
{
    const struct raster_vertex *v[4] = {a, b, c, a};
    float area = (b->x - a->x) * (c->y - a->y) - (c->x - a->x) * (b->y - a->y);
    float ymin = minf(a->y, minf(b->y, c->y));
    float ymax = maxf(a->y, maxf(b->y, c->y));

    t->xmin = minf(a->x, minf(b->x, c->x));
    t->xmax = maxf(a->x, maxf(b->x, c->x));
    if (!(area != 0) || a->q <= 0 || b->q <= 0 || c->q <= 0
        || !(ymax > 0 && t->xmax > 0 && ymin < (float)h
             && t->xmin < (float)w))
        return false;
    t->y0 = ceil_int(maxf(ymin, 0) - 0.5f);
    t->y1 = floor_int(minf(ymax, (float)h) - 0.5f);
    t->y0 = t->y0 < 0 ? 0 : t->y0;
    t->y1 = t->y1 >= h ? h - 1 : t->y1;
    float inv = 1 / area, sign = area < 0 ? -1 : 1;
    t->ox = a->x;
    t->oy = a->y;
    t->w[0] = (c->y - a->y) * inv;
    t->w[1] = -(c->x - a->x) * inv;
    t->w[2] = -(b->y - a->y) * inv;
    t->w[3] = (b->x - a->x) * inv;
    t->q[0] = t->w[0] * (b->q - a->q) + t->w[2] * (c->q - a->q);
    t->q[1] = t->w[1] * (b->q - a->q) + t->w[3] * (c->q - a->q);
    t->q[2] = a->q;
    for (int i = 0; i < 3; i++) {
        const struct raster_vertex *p = v[i], *q = v[i + 1];
        t->a[i] = sign * (p->y - q->y);
        t->b[i] = sign * (q->x - p->x);
        t->c[i] = sign * (p->x * q->y - q->x * p->y);
    }
    return t->y0 <= t->y1;
}

/* Samples x0..x1 of row y, on a grid w wide; false when there are none. */
static inline bool tri_row(const struct tri *t, int y, int w, int *x0,
                           int *x1)
{
    float lo = t->xmin, hi = t->xmax, fy = (float)y + 0.5f;

    for (int i = 0; i < 3; i++) {
        float rest = t->b[i] * fy + t->c[i];
        if (t->a[i] > 0)
            lo = maxf(lo, -rest / t->a[i]);
        else if (t->a[i] < 0)
            hi = minf(hi, -rest / t->a[i]);
        else if (rest < 0)
            return false;
    }
    if (!(hi >= 0 && lo <= (float)w && hi >= lo))
        return false;
    *x0 = ceil_int(maxf(lo, 0) - 0.5f);
    *x1 = floor_int(minf(hi, (float)w) - 0.5f);
    *x0 = *x0 < 0 ? 0 : *x0;
    *x1 = *x1 >= w ? w - 1 : *x1;
    return *x0 <= *x1;
}

/* Sample (x,y): its 1/z, and the weights w (3) of the corners. */
static inline float tri_at(float w[3], const struct tri *t, int x, int y)
{
    float dx = (float)x + 0.5f - t->ox, dy = (float)y + 0.5f - t->oy;

    w[1] = t->w[0] * dx + t->w[1] * dy;
    w[2] = t->w[2] * dx + t->w[3] * dy;
    w[0] = 1 - w[1] - w[2];
    return t->q[0] * dx + t->q[1] * dy + t->q[2];
}

#endif
