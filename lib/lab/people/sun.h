/* How a lamp infinitely far away, or a direction of the sky, sees the head: an
 * orthographic view and its map of heights. */
#ifndef SPID_LAB_PEOPLE_SUN_H
#define SPID_LAB_PEOPLE_SUN_H

#include <stddef.h>

#include "lib/base/vec3.h"
#include "lib/lab/people/scan_piece.h"
#include "lib/lab/people/tri.h"

#define SUN_FAR 8       /* added to heights: positive for the z-buffer */

struct sun {
    float u[3], v[3], w[3];     /* right, down, towards the lamp */
    float centre[3];
    float scale;                /* texels per head unit */
    float half;                 /* of the map's side, texels */
};

/* A view along dir about the origin, on a map of n by n that reaches so far; up
 * is where y is 1 or -1, or for what comes from there about, x. */
static inline void sun_aim(struct sun *s, const float dir[3], float y, int n,
                           float reach)
{
    const bool steep = fabsf(dir[1]) > 0.96f;
    const float up[3] = {steep ? 1 : 0, steep ? 0 : y, 0};

    *s = (struct sun){.centre = {0, 0, 0}};
    copy3(s->w, dir);
    cross3(s->u, up, s->w);
    unit3(s->u);
    cross3(s->v, s->w, s->u);
    s->half = 0.5f * (float)n;
    s->scale = (float)n / (2 * reach);
}

/* Its centre: the mean of every step-th of n points p (n,3). */
static inline void sun_centre(struct sun *s, const float *p, size_t n,
                              size_t step)
{
    s->centre[0] = s->centre[1] = s->centre[2] = 0;
    for (size_t i = 0; i < n; i += step)
        mad3(s->centre, s->centre, p + 3 * i,
             1 / (float)((n + step - 1) / step));
}

/* A point on the map, its height above the plane through the centre as q. */
static inline struct raster_vertex sun_place(const struct sun *s,
                                             const float p[3])
{
    float d[3];

    sub3(d, p, s->centre);
    return (struct raster_vertex){dot3(d, s->u) * s->scale + s->half,
                                  dot3(d, s->v) * s->scale + s->half,
                                  dot3(d, s->w) + SUN_FAR};
}

/* The greatest heights of faces (nf,3), whose corners lie at `at`, into map
 * (n,n); where the picture (NULL or empty: none) is clear at uv they have
 * holes. */
void sun_draw(float *map, int n, const struct raster_vertex *at,
              const int32_t *faces, size_t nf, const float *uv,
              const struct bitmap *picture);

#endif
