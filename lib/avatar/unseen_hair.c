/* The plane's Gaussians, mirrored to the side that no photograph shows
 * (unseen_hair.h). */
#include "lib/avatar/unseen_hair.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "lib/base/camera.h"

#define DRAWN 0.05f     /* opacity from which a Gaussian is worth mirroring */
#define CLEAR (1.0f / 255)      /* under this it is never drawn */
#define BODY 0.3f       /* neck blend weight from which it is no hair */
#define BEHIND 0.04f    /* what is hidden lies so far behind what is seen, head
                         * units: a Gaussian's own size */
#define SHOWN 0.5f      /* opacity from which one hides what is behind it */
#define EDGE 2.7f       /* standard deviations from a Gaussian's centre to where
                         * it ends, as REACH in dynamic_branch.c */

/* Place in [-1,1] and depth of a point in the photograph. */
static float unseen_hair_project(float at[2], const struct source_mesh *mesh,
                                 const float x[3])
{
    float z;

    camera_project(at, &z, mesh->cam, 2, x, 1);
    at[0] -= 1;
    at[1] -= 1;
    return z;
}

/* front (n,n) = depth of what each cell of the photograph shows: the mesh, or a
 * Gaussian of the plane; infinite where it shows nobody. */
static void unseen_hair_front(float *front, const struct branch_set *plane,
                              const struct source_mesh *mesh)
{
    memcpy(front, mesh->depth, mesh->n * mesh->n * sizeof *front);
    for (size_t k = 0; k < plane->n; k++) {
        float at[2];

        if (!(plane->opacity[k] > SHOWN))
            continue;
        const float z = unseen_hair_project(at, mesh, plane->mean + 3 * k);
        float *cell = front + source_mesh_cell(at, mesh->n);

        *cell = fminf(*cell, z);
    }
}

/* Whether the photograph shows something before all of a Gaussian at x, whose
 * largest standard deviation is `size`. */
static bool unseen_hair_hidden(const float x[3], float size,
                               const float *front,
                               const struct source_mesh *mesh)
{
    const size_t n = mesh->n;
    float at[2];
    const float z = unseen_hair_project(at, mesh, x);
    const float r = EDGE * size * CAMERA_FOCAL / z;

    if (!(fabsf(at[0]) + r < 1 && fabsf(at[1]) + r < 1))
        return false;
    const size_t from = source_mesh_cell((float[2]){at[0] - r, at[1] - r}, n);
    const size_t to = source_mesh_cell((float[2]){at[0] + r, at[1] + r}, n);

    for (size_t row = from - from % n; row <= to; row += n)
        for (size_t i = from % n; i <= to % n; i++)
            if (!(z > front[row + i] + BEHIND))
                return false;
    return true;
}

/* Row `to` becomes row k's mirror image. */
static void unseen_hair_mirror(struct branch_set *out, size_t to, size_t k)
{
    const float *m = out->mean + 3 * k, *q = out->quat + 4 * k;
    const size_t C = out->channels;

    memcpy(out->mean + 3 * to, (float[3]){-m[0], m[1], m[2]}, 3 * sizeof *m);
    memcpy(out->quat + 4 * to, (float[4]){q[0], q[1], -q[2], -q[3]},
           4 * sizeof *q);
    memcpy(out->scale + 3 * to, out->scale + 3 * k, 3 * sizeof *out->scale);
    memset(out->color + C * to, 0, C * sizeof *out->color);
    memcpy(out->color + C * to, out->color + C * k, 3 * sizeof *out->color);
    out->opacity[to] = out->opacity[k];
    out->neck[to] = out->neck[k];
    out->seen[to] = 0;
}

void unseen_hair_set(struct branch_set *out, uint32_t *from, float *front,
                     const struct source_mesh *mesh)
{
    size_t to = 0;

    unseen_hair_front(front, out, mesh);
    memset(from, 0, out->n * sizeof *from);
    for (size_t k = 0; k < out->n; k++) {
        const float *m = out->mean + 3 * k, *s = out->scale + 3 * k;

        if (from[k] || !(out->opacity[k] > DRAWN) || out->neck[k] > BODY)
            continue;
        if (!unseen_hair_hidden((float[3]){-m[0], m[1], m[2]},
                                fmaxf(s[0], fmaxf(s[1], s[2])), front, mesh))
            continue;
        while (to < out->n && out->opacity[to] >= CLEAR)
            to++;
        if (to == out->n)
            return;
        unseen_hair_mirror(out, to, k);
        from[to] = (uint32_t)k + 1;
    }
}

/* dto (n) += by (n) d (n), and d becomes 0. */
static void unseen_hair_move(float *dto, float *d, const float *by, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        dto[i] += by[i] * d[i];
        d[i] = 0;
    }
}

void unseen_hair_backward(struct branch_set *dout, const uint32_t *from)
{
    static const float one[3] = {1, 1, 1}, mean[3] = {-1, 1, 1};
    static const float quat[4] = {1, 1, -1, -1};
    const size_t C = dout->channels;

    for (size_t i = 0; i < dout->n; i++) {
        if (!from[i])
            continue;
        const size_t k = from[i] - 1;

        unseen_hair_move(dout->mean + 3 * k, dout->mean + 3 * i, mean, 3);
        unseen_hair_move(dout->quat + 4 * k, dout->quat + 4 * i, quat, 4);
        unseen_hair_move(dout->scale + 3 * k, dout->scale + 3 * i, one, 3);
        unseen_hair_move(dout->color + C * k, dout->color + C * i, one, 3);
        unseen_hair_move(dout->opacity + k, dout->opacity + i, one, 1);
        memset(dout->color + C * i, 0, C * sizeof *dout->color);
    }
}
