/* The grain of a head (grain.h). */
#include "lib/avatar/grain.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/avatar/coverage.h"
#include "lib/avatar/material.h"
#include "lib/base/camera.h"
#include "lib/base/parallel.h"
#include "lib/base/slices.h"
#include "lib/base/vec3.h"
#include "lib/photo/quilt.h"

#define COARSE 2.3f     /* standard deviation of the mesh's disks, pixels (BRANCH_OVERLAP
                         * of 2.8 mm): what is smoother they show themselves */
#define SQUARE 0.5f     /* cosine from which the photograph shows grain as it is */
#define LIKELY 0.5f     /* trust from which skin is seen, and chance of a pixel's
                         * material, by mesh and colour */

#define NONE 0          /* labels of pixels; m + 1 is material m */
#define OUTSIDE 0.5f    /* chance of hair, and of cloth, beside the mesh */

int grain_init(struct grain *g, const struct head *h, size_t N, size_t size,
               struct nn_options opt, struct error *err)
{
    const size_t P = size * size, labels = (P + 3) / 4;
    struct grain_work *w = &g->work;
    const struct slice slices[] = {
        {&g->picture, labels, false}, {&g->around, 2 * N, false}
    };

    *g = (struct grain){.size = size};
    nn_plan_init(&g->maps, opt);
    w->depth = nn_plan_map(&g->maps, P);
    w->drawn = nn_plan_map(&g->maps, GRAIN_VALUES * P);
    w->from = nn_plan_map(&g->maps, P);
    w->out = nn_plan_map(&g->maps, P);
    w->known = nn_plan_map(&g->maps, P);
    w->tmp = nn_plan_map(&g->maps, P);
    w->scratch = nn_plan_map(&g->maps, MATERIALS * QUILT_SCRATCH(size));
    w->is = (uint8_t *)nn_plan_map(&g->maps, labels);
    w->want = (uint8_t *)nn_plan_map(&g->maps, labels);
    w->vertex = nn_plan_map(&g->maps, 3 * h->V);
    w->value = nn_plan_map(&g->maps, GRAIN_VALUES * h->V);
    w->face = (int32_t *)nn_plan_map(&g->maps, 3 * h->F);
    return nn_plan_finish(&g->maps, err) ||
           slices_allocate(&g->block, slices, sizeof slices / sizeof *slices,
                           false, err) ? -1 : 0;
}

void grain_release(struct grain *g)
{
    nn_plan_release(&g->maps);
    free(g->block);
    memset(g, 0, sizeof *g);
}

/* ---- around the head ----------------------------------------------------- */

/* x as the source's camera has it, from the head's origin, but for the way to the
 * axis that the head is unrolled about: upright before that camera, through the
 * origin, and from there up leaning back, since about an upright one the crown
 * would be drawn to a point. */
static void grain_about(float q[3], const float x[3], const float cam[12])
{
    for (int i = 0; i < 3; i++)
        q[i] = dot3(cam + 4 * i, x);
    q[2] -= fmaxf(-q[1], 0);
}

/* How far n points x (N,3) are from the axis, the mean. */
static float grain_radius(const float *x, size_t n, const float cam[12])
{
    float sum = 0;

    for (size_t k = 0; k < n; k++) {
        float q[3];

        grain_about(q, x + 3 * k, cam);
        sum += hypotf(q[0], q[2]);
    }
    return sum / (float)n;
}

PARALLEL(grain_unroll, k, float *, around, float *, vertex, const float *, x,
         const float *, cam, float, radius, size_t, V)
{
    const float scale = CAMERA_FOCAL / fmaxf(cam[11], CAMERA_NEAR);
    float q[3];

    grain_about(q, x + 3 * k, cam);
    const float at[2] = {
        scale * (cam[3] + radius * atan2f(q[0], -q[2])),
        scale * (cam[7] + q[1])
    };
    for (int i = 0; i < 2; i++)
        around[2 * k + (size_t)i] = (at[i] + 1) / 2;
    if (k >= V)
        return;
    /* what is further from the axis lies before what is nearer to it */
    const float z = 1 / (1 + hypotf(q[0], q[2]));

    vertex[3 * k] = at[0] * z / CAMERA_FOCAL;
    vertex[3 * k + 1] = at[1] * z / CAMERA_FOCAL;
    vertex[3 * k + 2] = z;
}

/* The faces that do not reach around the back; returns how many. */
static size_t grain_faces(int32_t *to, const float *around,
                          const struct head *h)
{
    size_t n = 0;

    for (size_t f = 0; f < h->F; f++) {
        const int32_t *v = h->f + 3 * f;
        const float u[3] = {around[2 * v[0]], around[2 * v[1]],
                            around[2 * v[2]]};

        if (fmaxf(u[0], fmaxf(u[1], u[2])) - fminf(u[0], fminf(u[1], u[2])) <
            0.5f)
            memcpy(to + 3 * n++, v, 3 * sizeof *v);
    }
    return n;
}

/* ---- materials ----------------------------------------------------------- */

/* What each vertex shows. */
static void grain_values(float *value, const struct dynamic_branch *b)
{
    for (size_t v = 0; v < b->dense->V; v++, value += GRAIN_VALUES) {
        float confidence = 0;

        for (size_t m = 0; m < MATERIALS; m++)
            confidence += b->as[m * b->count + v];
        value[GRAIN_CONFIDENCE] = b->facing[v] < SQUARE ? 0 : confidence;
        value[GRAIN_HAIR] = b->chance[MATERIAL_HAIR * b->count + v];
        value[GRAIN_CLOTH] = b->chance[MATERIAL_CLOTH * b->count + v];
    }
}

/* Which material the photograph's pixel i shows, or NONE. */
static uint8_t grain_is(const struct grain_work *w, const float rgba[4],
                        const struct material_colors *colors, size_t i)
{
    const float *drawn = w->drawn + GRAIN_VALUES * i;
    const bool outside = !isfinite(w->depth[i]);
    const float hair = outside ? OUTSIDE : drawn[GRAIN_HAIR];
    const float cloth = outside ? OUTSIDE : drawn[GRAIN_CLOTH];
    const float chance[MATERIALS] = {
        [MATERIAL_SKIN] = 1 - hair - cloth, [MATERIAL_HAIR] = hair,
        [MATERIAL_CLOTH] = cloth
    };
    float odds[MATERIALS], sum = 0;
    size_t best = 0;

    if (rgba[3] < COVERAGE_WHOLE)
        return NONE;
    material_odds(odds, rgba, colors);
    for (size_t m = 0; m < MATERIALS; m++) {
        odds[m] *= chance[m];
        sum += odds[m];
        best = odds[m] > odds[best] ? m : best;
    }
    /* eyes, lips and nostrils are no skin */
    return odds[best] < LIKELY * sum ||
                   (best == MATERIAL_SKIN && drawn[GRAIN_CONFIDENCE] < LIKELY)
               ? NONE : (uint8_t)(best + 1);
}

/* That, and its brightness. */
PARALLEL(grain_observe, i, const struct grain_work *, w,
         const struct material_colors *, colors, const float *, rgba)
{
    const float *p = rgba + 4 * i;

    w->is[i] = grain_is(w, p, colors, i);
    w->known[i] = w->is[i] != NONE;
    w->from[i] = w->is[i] == NONE
                     ? 0 : logf((p[0] + 2 * p[1] + p[2]) / 4 +
                                SRGB_DARK);
}

/* And what of that is finer than the mesh. */
static void grain_fine(struct grain *g)
{
    const size_t P = g->size * g->size;
    struct grain_work *w = &g->work;
    float *smooth = w->out, *weight = w->depth;

    coverage_blur(smooth, w->from, g->size, COARSE, w->tmp);
    coverage_blur(weight, w->known, g->size, COARSE, w->tmp);
    for (size_t i = 0; i < P; i++)
        w->from[i] -= w->known[i] > 0 ? smooth[i] / weight[i] : 0;
}

/* Pixel i of the picture around: what is to be there. */
PARALLEL(grain_want, i, struct grain_work *, w)
{
    const float *drawn = w->drawn + GRAIN_VALUES * i;
    const float hair = drawn[GRAIN_HAIR], cloth = drawn[GRAIN_CLOTH];
    const float skin = 1 - hair - cloth, max = fmaxf(skin, fmaxf(hair, cloth));
    const enum material m = skin == max ? MATERIAL_SKIN
                          : hair == max ? MATERIAL_HAIR : MATERIAL_CLOTH;

    w->want[i] = isfinite(w->depth[i]) ? (uint8_t)(m + 1) : NONE;
    w->out[i] = 0;
}

PARALLEL(grain_cover, m, const struct quilt *, q, float *, scratch)
{
    quilt_cover(q, (uint8_t)(m + 1), scratch + m * QUILT_SCRATCH(q->n));
}

PARALLEL(grain_write, i, uint8_t *, picture, const float *, out)
{
    picture[i] = out[i] == 0 ? 128
                             : (uint8_t)fminf(128 * expf(out[i]) + 0.5f, 255);
}

/* ---- all of it ----------------------------------------------------------- */

void grain_find(struct grain *g, size_t n, size_t N,
                const struct dynamic_branch *b,
                const struct source_mesh *mesh,
                const struct source_picture *picture)
{
    static const float unit[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    const struct head *h = mesh->head;
    struct grain_work *w = &g->work;
    const size_t P = g->size * g->size;

    grain_values(w->value, b);
    coverage_depth(w->depth, w->drawn, GRAIN_VALUES, mesh->verts, w->value, h->f,
                   h->F, mesh->cam, g->size);
    parallel_each(grain_observe, P, 1, w, b->colors, picture->rgba);
    grain_fine(g);

    const float radius = grain_radius(b->verts, h->V, mesh->cam);
    parallel_each(grain_unroll, n, 1, g->around, w->vertex, b->verts,
                  mesh->cam, radius, h->V);
    const size_t F = grain_faces(w->face, g->around, h);
    coverage_depth(w->depth, w->drawn, GRAIN_VALUES, w->vertex, w->value,
                   w->face, F, unit, g->size);
    parallel_each(grain_want, P, 1, w);
    for (size_t k = 0; k < N; k++)
        if (k >= n || mesh->weights->lining[k] > 0 || b->lid[k] > 0)
            g->around[2 * k] = g->around[2 * k + 1] = GRAIN_NOWHERE;

    const struct quilt q = {g->size, w->from, w->is, w->want, w->out};

    parallel_each(grain_cover, MATERIALS, 1, &q, w->scratch);
    parallel_each(grain_write, P, 1, g->picture, w->out);
}
