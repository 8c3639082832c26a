/* The source's mesh as its camera sees it: neck blend, normals, coverage and
 * depth maps. */
#include "lib/avatar/source_mesh.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/avatar/coverage.h"
#include "lib/base/parallel.h"
#include "lib/base/slices.h"
#include "lib/base/camera.h"
#include "lib/base/neck_blend.h"

/* The head's faces, and a fan over the ring of the inner lips about vertex
 * V. */
static void source_mesh_close_lips(int32_t *faces, const struct head *h)
{
    const size_t L = h->nlip_inner;
    int32_t *fan = faces + 3 * h->F;

    memcpy(faces, h->f, 3 * h->F * sizeof *faces);
    for (size_t i = 0; i < L; i++) {
        fan[3 * i] = h->lip_inner[i];
        fan[3 * i + 1] = h->lip_inner[(i + 1) % L];
        fan[3 * i + 2] = (int32_t)h->V;
    }
}

int source_mesh_init(struct source_mesh *m, const struct head *h,
                     size_t n, struct error *err)
{
    size_t V = h->V, L = h->nlip_inner;
    const struct slice slices[] = {
        {&m->verts, 3 * (V + 1), false}, {&m->normals, 3 * V, false},
        {&m->faces, 3 * (h->F + L), false},
        {&m->moving_verts, V + 1, false},
        {&m->coverage, n * n, false}, {&m->depth, n * n, false},
        {&m->near, n * n, false},
        {&m->moving, n * n, false},
        {&m->raster, coverage_scratch(n) / sizeof(float) + 1, false}
    };

    m->head = h;
    m->weights = &h->avatar;
    m->n = n;
    if (slices_allocate(&m->block, slices, sizeof slices / sizeof *slices,
                        false, err))
        return -1;
    source_mesh_close_lips(m->faces, h);
    memcpy(m->moving_verts, h->avatar.moving, V * sizeof *m->moving_verts);
    m->moving_verts[V] = 1;
    return 0;
}

void source_mesh_release(struct source_mesh *m)
{
    free(m->block);
    memset(m, 0, sizeof *m);
}

void source_mesh_normal(float normal[3], const float cam[12])
{
    for (int i = 0; i < 3; i++)
        normal[i] = -cam[8 + i];
}

PARALLEL(source_mesh_project_part, i, float *, place, const float *, cam,
         const float *, x)
{
    camera_project(place + 2 * i, NULL, cam, 2, x + 3 * i, 1);
    place[2 * i] -= 1;
    place[2 * i + 1] -= 1;
}

void source_mesh_project(float *place, const float *x, size_t N,
                         const float cam[12])
{
    parallel_each(source_mesh_project_part, N, 1, place, cam, x);
}

size_t source_mesh_cell(const float place[2], size_t n)
{
    const float half = 0.5f * (float)n, last = (float)(n - 1);
    const float x = half * (place[0] + 1), y = half * (place[1] + 1);

    return (size_t)fminf(fmaxf(y, 0), last) * n +
           (size_t)fminf(fmaxf(x, 0), last);
}

float source_mesh_spacing(const struct source_mesh *m, size_t n)
{
    return 2.0f / (float)n * m->cam[11] / CAMERA_FOCAL;
}

/* Blend, then normals and maps of what the camera sees. */
void source_mesh_set(struct source_mesh *m, const float *posed,
                     const float *rest, const float cam[12], bool blend)
{
    const struct head *h = m->head;
    const struct head_avatar *w = m->weights;

    m->posed = posed;
    m->rest = rest ? rest : posed;
    memcpy(m->cam, cam, sizeof m->cam);
    source_mesh_normal(m->normal, cam);
    m->blend = blend;
    neck_blend_body(m->body, w->neck_blend, neck_blend_upright, cam);
    if (blend)
        neck_blend_points(m->verts, posed, w->neck, h->V, m->body);
    else
        memcpy(m->verts, posed, 3 * h->V * sizeof *m->verts);
    head_normals(m->normals, h, m->verts);
    head_centroid(m->verts + 3 * h->V, h->lip_inner, h->nlip_inner,
                  m->verts);
    const size_t F = h->F + h->nlip_inner;
    coverage_map(m->coverage, m->verts, m->faces, F, cam, m->n, m->raster);
    coverage_depth(m->depth, m->moving, 1, m->verts, m->moving_verts, m->faces,
                   F, cam, m->n);
    coverage_near(m->near, m->depth, m->n,
                  (size_t)lroundf(SOURCE_MESH_OFF /
                                  source_mesh_spacing(m, m->n)), m->raster);
}
