/* Heights over the bare mesh: of hair, and below 0 of a neck (relief.h). */
#include "lib/avatar/relief.h"

#include <math.h>
#include <string.h>

#include "lib/base/parallel.h"
#include "lib/base/vec3.h"

/* Each half and twice: tests/bench/README.md, "The constants of hidden hair". */
#define RISE 0.1f       /* head units, 2 cm: halfway from short hair to long */
#define CORRELATED 40   /* vertices beside which is the same: less than a colour
                         * says, since a tail beside the neck is not long hair */
#define PARTS 16        /* of a height, by which it is taken back */
#define SOFT 0.05f      /* head units: hair that is lower keeps the mesh's shape */
#define SWEEPS 20       /* of Jacobi's: over about four vertices, 3 cm */
#define STEP 0.7f       /* of the way each goes: less than whole, or Jacobi's may
                         * swing */
#define TALL 0.2f       /* head units: hair beside the head, and a neck's edge, is
                         * followed so far */
#define FIRM 10         /* weight of a height on the outline, for one of a step */
#define LOOSE 0.1f      /* of the styles': 1 / sqrt(LOOSE) vertices, 2 cm, away from
                         * the outline a third is left of what it asks for */
#define SPREAD 40       /* Jacobi's sweeps, after which (1 + LOOSE)^-SPREAD, a
                         * fiftieth, is left to do */

/* Where vertex v, raised by `height`, is in the picture (2); returns its depth. */
static float relief_place(float place[2], const struct source_mesh *mesh,
                          size_t v, float height)
{
    const float *row = mesh->cam + 8;
    float x[3];

    for (size_t c = 0; c < 3; c++)
        x[c] = mesh->verts[3 * v + c] + height * mesh->normals[3 * v + c];
    source_mesh_project(place, x, 1, mesh->cam);
    return row[0] * x[0] + row[1] * x[1] + row[2] * x[2] + row[3];
}

/* Whether the picture shows what vertex v, raised as far as some hair is, has beside
 * the bare mesh: there, place (2). */
static bool relief_is_outside(float place[2], const struct source_picture *picture,
                              const struct source_mesh *mesh, size_t v)
{
    relief_place(place, mesh, v, RISE);
    return source_picture_contains(picture, place) &&
           !isfinite(mesh->depth[source_mesh_cell(place, mesh->n)]);
}

void relief_likelihood(float *likelihood, const struct material_colors *colors,
                       const struct source_picture *picture,
                       const struct source_mesh *mesh)
{
    const struct head_avatar *a = mesh->weights;

    memset(likelihood, 0, HEAD_STYLES * sizeof *likelihood);
    for (size_t v = 0; v < a->V; v++) {
        float place[2], rgba[4], odds[MATERIALS];

        if (!relief_is_outside(place, picture, mesh, v))
            continue;
        source_picture_sample(rgba, picture, place, 1);
        material_odds(odds, rgba, colors);
        /* else as often nothing as something: skin or cloth */
        const float other = (1 - rgba[3]) / 2 +
            rgba[3] * (odds[MATERIAL_SKIN] + odds[MATERIAL_CLOTH]) / 4;
        for (size_t s = 0; s < HEAD_STYLES; s++) {
            const float hair = material_limited(
                a->relief[HEAD_STYLES * v + s] / (2 * RISE));

            likelihood[s] += logf(hair * rgba[3] * odds[MATERIAL_HAIR] +
                                  (1 - hair) * other) / CORRELATED;
        }
    }
}

void relief_expect(float *relief, const struct material_share *share,
                   const struct head_avatar *a)
{
    for (size_t v = 0; v < a->V; v++) {
        relief[v] = 0;
        for (size_t s = 0; s < HEAD_STYLES; s++)
            relief[v] += share->hair[s] * a->relief[HEAD_STYLES * v + s];
    }
}

void relief_find(float *relief, const struct relief_work *work,
                 const struct white_point_colors *seen, const float *held,
                 const struct source_picture *picture,
                 const struct source_mesh *mesh, const struct densify *d)
{
    const struct head_avatar *a = mesh->weights;

    material_learn(work->colors, work->chance, seen, held, a, d);
    relief_likelihood(work->likelihood, work->colors, picture, mesh);
    const struct material_share share =
        material_person(work->odds, work->colors, work->likelihood, seen, held, a, d);
    relief_expect(relief, &share, a);
    material_expect(work->chance, &share, a, d);
}

/* Whether the picture would not have shown vertex v raised by `height`. */
static bool relief_is_hidden(const struct source_picture *picture,
                             const struct source_mesh *mesh, size_t v,
                             float height)
{
    float place[2], rgba[4];
    const float z = relief_place(place, mesh, v, height);

    if (!source_picture_contains(picture, place))
        return true;
    source_picture_sample(rgba, picture, place, 1);
    return rgba[3] > 0.5f && mesh->depth[source_mesh_cell(place, mesh->n)] < z;
}

PARALLEL(relief_limit_part, v, float *, relief, const float *, front,
         const struct source_picture *, picture,
         const struct source_mesh *, mesh)
{
    const float all = relief[v] * (1 - front[v]);
    int part = PARTS;

    while (part && !relief_is_hidden(picture, mesh, v,
                                     all * (float)part / PARTS))
        part--;
    relief[v] = all * (float)part / PARTS;
}

void relief_limit(float *relief, const float *front,
                  const struct source_picture *picture,
                  const struct source_mesh *mesh)
{
    parallel_each(relief_limit_part, mesh->head->V, 1, relief, front, picture,
                  mesh);
}

/* What the picture shows (4) where vertex v, raised by `height`, is; whether it does. */
static bool relief_sample(float rgba[4], const struct source_picture *picture,
                          const struct source_mesh *mesh, size_t v, float height)
{
    float place[2];

    relief_place(place, mesh, v, height);
    if (!source_picture_contains(picture, place))
        return false;
    source_picture_sample(rgba, picture, place, 1);
    return true;
}

/* How far from vertex v along its normal the picture shows hair. */
static float relief_follow(const struct source_picture *picture,
                           const struct source_mesh *mesh,
                           const struct material_colors *colors, size_t v)
{
    int part = 0;

    for (; part < PARTS; part++) {
        float rgba[4], odds[MATERIALS];

        if (!relief_sample(rgba, picture, mesh, v,
                           TALL * (float)(part + 1) / PARTS))
            break;
        material_odds(odds, rgba, colors);
        if (rgba[3] < 0.5f || odds[MATERIAL_HAIR] < 1)
            break;
    }
    return TALL * (float)part / PARTS;
}

/* How far vertex v has to go along its normal, inwards, to be within the person;
 * 0 where the picture ends first. */
static float relief_draw_in(const struct source_picture *picture,
                            const struct source_mesh *mesh, size_t v)
{
    for (int part = 0; part < PARTS; part++) {
        const float height = -TALL * (float)part / PARTS;
        float rgba[4];

        if (!relief_sample(rgba, picture, mesh, v, height))
            return 0;
        if (rgba[3] >= 0.5f)
            return height;
    }
    return -TALL;
}

/* height (V), which comes as zeros: as near to want (V) as weight (V) asks for, and to
 * its neighbours'.  sum (V) scratch. */
static void relief_spread(float *height, const float *want, const float *weight,
                          float *sum, const struct densify *d)
{
    for (int sweep = 0; sweep < SPREAD; sweep++) {
        memset(sum, 0, d->V * sizeof *sum);
        for (size_t h = 0; h < 2 * d->E; h++)
            sum[d->edge[h]] += height[d->edge[h ^ 1]];
        for (size_t v = 0; v < d->V; v++)
            height[v] = (sum[v] / (float)d->degree[v] + weight[v] * want[v]) /
                        (1 + weight[v] + LOOSE);
    }
}

void relief_meet(float *relief, const float *rim, const float *hair,
                 const struct material_colors *colors,
                 const struct source_picture *picture,
                 const struct source_mesh *mesh, const struct densify *d,
                 float *scratch)
{
    float *more = scratch, *sum = more + d->V, *weight = sum + d->V;
    float *want = weight + d->V;

    for (size_t v = 0; v < d->V; v++) {
        float place[2];

        more[v] = want[v] = 0;
        weight[v] = FIRM * rim[v] * hair[v];
        if (weight[v] > 0 && !relief_is_outside(place, picture, mesh, v))
            weight[v] = 0;
        if (weight[v] > 0)
            want[v] = relief_follow(picture, mesh, colors, v) - relief[v];
    }
    relief_spread(more, want, weight, sum, d);
    const int32_t *region = mesh->head->region;
    for (size_t v = 0; v < d->V; v++) {
        float place[2];

        relief[v] = fmaxf(relief[v] + hair[v] * more[v], 0);
        more[v] = want[v] = weight[v] = 0;
        if (rim[v] > 0 && region && region[v] == REGION_NECK &&
            relief_is_outside(place, picture, mesh, v)) {
            weight[v] = FIRM * rim[v];
            want[v] = relief_draw_in(picture, mesh, v);
        }
    }
    relief_spread(more, want, weight, sum, d);
    for (size_t v = 0; v < d->V; v++)
        relief[v] += more[v];
}

void relief_drape(float *offset, float *tmp, const float *relief,
                  const struct source_mesh *mesh, const struct densify *d)
{
    for (size_t i = 0; i < 3 * d->V; i++)
        offset[i] = relief[i / 3] * mesh->normals[i];
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        memset(tmp, 0, 3 * d->V * sizeof *tmp);
        for (size_t h = 0; h < 2 * d->E; h++) {
            float *to = tmp + 3 * d->edge[h];
            const size_t from = 3 * (size_t)d->edge[h ^ 1];

            for (size_t c = 0; c < 3; c++)
                to[c] += mesh->verts[from + c] + offset[from + c];
        }
        for (size_t i = 0; i < 3 * d->V; i++) {
            const size_t v = i / 3;
            const float by = STEP * clampf(relief[v] / SOFT, 0, 1);

            offset[i] += by * (tmp[i] / (float)d->degree[v] - mesh->verts[i] -
                               offset[i]);
        }
    }
}
