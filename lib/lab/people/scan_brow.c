/* Brows of photographs: how much darker than the skin about them, against the
 * person's darkest hair; mean and principal components of that. */
#include "lib/lab/people/scan_brow.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "lib/base/sort.h"
#include "lib/lab/people/scan_skin_fit.h"
#include "lib/base/vec3.h"

#define N SKIN_SIZE
#define W BROW_W
#define H BROW_H
#define EDGE 6                  /* rows above and below that show skin */
#define BROW_MIDDLE 73          /* texels of its length */
#define BROW_LONG 0.96f         /* of its length, in the photographs */
#define CONTRAST_MIN 0.4f     /* log luminance between hair and skin */

int brow_fit_init(struct brow_fit *t, size_t n, struct arena *memory,
                  struct error *err)
{
    *t = (struct brow_fit){
        .n = 2 * n,
        .dense = arena_take(memory, 2 * n * BROW_PLANE, sizeof *t->dense),
        .seen = arena_take(memory, 2 * n, 1)
    };
    return arena_check(memory, "brows", err);
}

/* The texel of the square under (x, y) of a brow, mirrored or not. */
static size_t brow_texel(int x, int y, bool mirror)
{
    int u = BROW_X + x;

    return (size_t)(BROW_Y + y) * N + (size_t)(mirror ? N - 1 - u : u);
}

/* The value that the share `part` of v (n) lies below; v is sorted. */
static float brow_quantile(float *v, size_t n, float part)
{
    if (!n)
        return 0;
    sort_floats(v, n);
    return v[(size_t)(part * (float)(n - 1))];
}

/* o <- how much darker each texel is than the skin over and under the brow.
 * Returns the difference of its dark hair. */
static float brow_darkness(float *o, const float *log, const uint8_t *where,
                           bool mirror)
{
    float v[BROW_PLANE], level[2];
    size_t n = 0;

    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++) {
            const float *l = log + 3 * brow_texel(x, y, mirror);
            o[y * W + x] = 0.3f * l[0] + 0.5f * l[1] + 0.2f * l[2];
        }
    for (int side = 0; side < 2; side++) {
        memcpy(v, o + (side ? (H - EDGE) * W : 0), EDGE * W * sizeof *v);
        level[side] = brow_quantile(v, EDGE * W, 0.6f);
    }
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++) {
            float *at = &o[y * W + x];

            *at = lerpf(level[0], level[1], (float)y / (H - 1)) - *at;
            if (where[brow_texel(x, y, mirror)] == 255)
                v[n++] = *at;
        }
    return brow_quantile(v, n, 0.85f);
}

void brow_fit_add(struct brow_fit *t, size_t i, const float *log,
                  const uint8_t *where)
{
    for (size_t side = 0; side < 2; side++) {
        float *o = t->dense + (2 * i + side) * BROW_PLANE;
        float dark = brow_darkness(o, log, where, side);

        t->seen[2 * i + side] = dark > CONTRAST_MIN;
        for (int y = 0; y < H; y++)
            for (int x = 0; x < W; x++) {
                float in = where[brow_texel(x, y, side)] / 255.0f;
                float *at = &o[y * W + x];

                *at = in * clampf((*at / dark - 0.25f) / 0.75f, 0, 1);
            }
    }
}

int brow_fit_finish(struct brow_model *m, struct brow_fit *t,
                    struct arena *memory, struct error *err)
{
    size_t n = 0;

    for (size_t i = 0; i < t->n; i++)
        if (t->seen[i])
            memmove(t->dense + BROW_PLANE * n++, t->dense + BROW_PLANE * i,
                    BROW_PLANE * sizeof *t->dense);
    m->mean = arena_take(memory, BROW_PLANE, sizeof *m->mean);
    if (arena_check(memory, "brows", err))
        return -1;
    for (size_t p = 0; p < BROW_PLANE; p++) {
        for (size_t i = 0; i < n; i++)
            m->mean[p] += t->dense[i * BROW_PLANE + p] / (float)n;
        for (size_t i = 0; i < n; i++)
            t->dense[i * BROW_PLANE + p] -= m->mean[p];
    }
    m->parts = BROW_PARTS < (int)n ? BROW_PARTS : (int)n;
    m->part = skin_find_parts(t->dense, n, BROW_PLANE, 1, m->parts, memory,
                              err);
    return m->part ? 0 : -1;
}

void brow_paint(uint8_t *out, const struct brow_model *m,
                const float z[2][BROW_PARTS])
{
    for (size_t side = 0; side < 2; side++)
        for (size_t p = 0; p < BROW_PLANE; p++) {
            float v = m->mean[p];

            for (int k = 0; k < m->parts; k++)
                v += z[side][k] * m->part[(size_t)k * BROW_PLANE + p];
            /* what many have in common is softer than each of them */
            out[side * BROW_PLANE + p]
                = (uint8_t)(255 * ramp(0.12f, 0.75f, v) + 0.5f);
        }
}

/* On the scans' bones the photographs' brows come out higher, most of all near
 * the nose, and shorter than a landmarker finds them in the photographs: there
 * they are put right. */
float brow_density(const uint8_t *brow, float u, float v)
{
    bool mirror = u > 0.5f;
    float x = (mirror ? 1 - u : u) * N - 0.5f - BROW_X;
    float y = (1 - v) * N - 0.5f - BROW_Y - lerpf(3, 8, ramp(20, 125, x));

    x = clampf(lerpf(BROW_MIDDLE, x, BROW_LONG), 0, W - 1.001f);
    y = clampf(y, 0, H - 1.001f);
    int x0 = (int)x, y0 = (int)y;
    const uint8_t *a = brow + mirror * BROW_PLANE + (size_t)(y0 * W + x0);
    float fx = x - (float)x0, fy = y - (float)y0;

    return lerpf(lerpf(a[0], a[1], fx), lerpf(a[W], a[W + 1], fx), fy) / 255;
}
