/* Faces into a map of heights. */
#include "lib/lab/people/sun.h"

#define CLEAR 0.5f              /* alpha below which a picture is a hole */

/* Whether the picture has a hole at weights w of corners v. */
static bool sun_is_hole(const struct bitmap *picture, const float *uv,
                        const int32_t *v, const float w[3])
{
    float c[4], at[2] = {0, 0};

    if (!picture || !picture->rgba)
        return false;
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 2; i++)
            at[i] += w[k] * uv[2 * v[k] + i];
    bitmap_sample(c, picture, at[0], at[1]);
    return c[3] < CLEAR;
}

void sun_draw(float *map, int n, const struct raster_vertex *at,
              const int32_t *faces, size_t nf, const float *uv,
              const struct bitmap *picture)
{
    for (size_t i = 0; i < nf; i++) {
        const int32_t *v = faces + 3 * i;
        struct tri t;
        int x0, x1;

        if (!tri_setup(&t, &at[v[0]], &at[v[1]], &at[v[2]], n, n))
            continue;
        for (int y = t.y0; y <= t.y1; y++) {
            if (!tri_row(&t, y, n, &x0, &x1))
                continue;
            for (int x = x0; x <= x1; x++) {
                float w[3], q = tri_at(w, &t, x, y);

                if (q > map[y * n + x] && !sun_is_hole(picture, uv, v, w))
                    map[y * n + x] = q;
            }
        }
    }
}
