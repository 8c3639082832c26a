/* The strip behind the cheeks: where it is, and its Gaussians
 * (cheek_back.h). */
#include "lib/avatar/cheek_back.h"

#include <math.h>
#include <string.h>

#include "lib/avatar/static_branch.h"
#include "lib/base/parallel.h"

/* The strip: its width and its distance from the outline, so that none of its
 * Gaussians stands out from a turned head's cheek; half sides of the
 * picture. */
#define WIDTH 0.05f
#define INSET 0.01f
/* Its Gaussians: cells from one to the next, standard deviation over that
 * distance, opacity. */
#define STEP 2
#define OVERLAP 0.6f
#define SOLID 0.97f
/* Its depth: this share of the way from the skin to where that turns away,
 * which counts as DEEPEST head units behind the skin at most. */
#define WITHIN 0.5f
#define DEEPEST 0.15f
/* How far the skin about it moves (head_avatar.h, moving) where there is none
 * of it and where all is: none behind the temples, whose outline stays. */
#define MOVES 6.0f
#define MOVES_FAR 9.0f

/* Directions of the places about a cell. */
#define AROUND 8
static const float cheek_back_turn[AROUND][2] = {
    {1, 0}, {0.7071f, 0.7071f}, {0, 1}, {-0.7071f, 0.7071f},
    {-1, 0}, {-0.7071f, -0.7071f}, {0, -1}, {0.7071f, -0.7071f}
};

/* The places (8,2) at this distance from cell (x,y); returns how far the mesh
 * moves there at most. */
static float cheek_back_neighbours(float *at, const struct source_mesh *mesh,
                                   size_t x, size_t y, float distance)
{
    const float half = 0.5f * (float)mesh->n, last = (float)(mesh->n - 1);
    float moving = 0;

    for (size_t i = 0; i < AROUND; i++) {
        const float *turn = cheek_back_turn[i];
        const float u = (float)x + 0.5f + half * distance * turn[0];
        const float v = (float)y + 0.5f + half * distance * turn[1];
        const size_t j = (size_t)fminf(fmaxf(u, 0), last);
        const size_t k = (size_t)fminf(fmaxf(v, 0), last);

        at[2 * i] = u / half - 1;
        at[2 * i + 1] = v / half - 1;
        moving = fmaxf(moving, mesh->moving[k * mesh->n + j]);
    }
    return moving;
}

/* The least matte at the places (8,2). */
static float cheek_back_matte(const struct source_picture *picture,
                              const float *at)
{
    float rgba[4 * AROUND], matte = 1;

    source_picture_sample(rgba, picture, at, AROUND);
    for (size_t i = 0; i < AROUND; i++)
        matte = fminf(matte, rgba[4 * i + 3]);
    return matte;
}

float cheek_back_at(const struct source_picture *picture,
                    const struct source_mesh *mesh, size_t x, size_t y)
{
    float at[2 * AROUND];

    if (!(mesh->coverage[y * mesh->n + x] > 0))
        return 0;
    const float moves = branch_ramp(
        cheek_back_neighbours(at, mesh, x, y, WIDTH), MOVES, MOVES_FAR);
    if (!(moves > 0))           /* most: their matte is not looked up */
        return 0;
    return moves * (1 - branch_ramp(cheek_back_matte(picture, at), 0.3f, 0.7f));
}

/* How far cell (x,y) lies inside the outline, 0..1. */
static float cheek_back_inside(const struct source_picture *picture,
                               const struct source_mesh *mesh, size_t x,
                               size_t y)
{
    float at[2 * AROUND];

    cheek_back_neighbours(at, mesh, x, y, INSET);
    return branch_ramp(cheek_back_matte(picture, at), 0.6f, 0.95f);
}

/* One chunk. */
PARALLEL(cheek_back_find_part, k, float *, back,
         const struct source_picture *, picture,
         const struct source_mesh *, mesh, size_t, n)
{
    size_t y = k * STEP;

    for (size_t x = 0; x < n; x += STEP) {
        float *at = back + y * n + x;

        *at = cheek_back_at(picture, mesh, x, y);
        if (*at > 0)
            *at *= cheek_back_inside(picture, mesh, x, y);
    }
}

void cheek_back_find(float *back, const struct source_picture *picture,
                     const struct source_mesh *mesh, size_t n)
{
    memset(back, 0, n * n * sizeof *back);

    parallel_each(cheek_back_find_part, (n + STEP - 1) / STEP, 1, back, picture,
                  mesh, n);
}

/* Camera depth of the strip at cell k: half way from the skin there to where it
 * turns away, the farthest skin about it.  That is inside the jaw, which hides
 * it on turned heads, too. */
static float cheek_back_depth(const struct source_mesh *mesh, size_t k)
{
    const float half = 0.5f * (float)mesh->n, last = (float)(mesh->n - 1);
    const float own = mesh->depth[k];
    float deepest = own;

    for (size_t i = 0; i < 2 * AROUND; i++) {
        const float *turn = cheek_back_turn[i / 2];
        const float way = half * WIDTH * (i % 2 ? 1 : 0.5f);
        const float x = (float)(k % mesh->n) + way * turn[0];
        const float y = (float)(k / mesh->n) + way * turn[1];
        const size_t at = (size_t)fminf(fmaxf(y, 0), last) * mesh->n +
                          (size_t)fminf(fmaxf(x, 0), last);
        const float depth = mesh->depth[at];

        if (isfinite(depth))
            deepest = fmaxf(deepest, fminf(depth, own + DEEPEST));
    }
    return own + WITHIN * (deepest - own);
}

/* Cell k of n by n becomes a Gaussian of the strip. */
static void cheek_back_place(struct branch_set *out, size_t k, float back,
                             const struct source_picture *picture,
                             const struct source_mesh *mesh, size_t n)
{
    static const float unturned[4] = {1, 0, 0, 0};
    const float U[2] = {(float)(2 * (k % n) + 1) / (float)n - 1,
                        (float)(2 * (k / n) + 1) / (float)n - 1};
    const float cell = source_mesh_spacing(mesh, n);
    const float skin = mesh->cam[11] - cheek_back_depth(mesh, k);
    const float rise = fminf(fmaxf(skin, 0), STATIC_BRANCH_HEIGHT);
    const float p = 0.5f + 0.5f * rise;
    float rgba[4], *color = out->color + k * out->channels;

    source_picture_sample(rgba, picture, U, 1);
    static_branch_lift(out->mean + 3 * k, U, &p, &rise, mesh->cam,
                       mesh->normal, 1);
    for (size_t i = 0; i < 3; i++)
        out->scale[3 * k + i] = fminf(OVERLAP * STEP * cell, BRANCH_SCALE_MAX);
    memcpy(out->quat + 4 * k, unturned, sizeof unturned);
    memset(color, 0, out->channels * sizeof *color);
    memcpy(color, rgba, 3 * sizeof *color);
    out->opacity[k] = SOLID * back * fminf(fmaxf(rgba[3], 0), 1);
    out->seen[k] = rgba[3] > 0 ? 1 : 0;
}

void cheek_back_set(struct branch_set *out, const float *back,
                    const struct source_picture *picture,
                    const struct source_mesh *mesh, size_t n)
{
    for (size_t k = 0; k < out->n; k++)
        if (back[k] > 0)
            cheek_back_place(out, k, back[k], picture, mesh, n);
}

void cheek_back_backward(struct branch_set *dout, const float *back)
{
    for (size_t k = 0; k < dout->n; k++) {
        if (!(back[k] > 0))
            continue;
        memset(dout->mean + 3 * k, 0, 3 * sizeof *dout->mean);
        memset(dout->scale + 3 * k, 0, 3 * sizeof *dout->scale);
        memset(dout->quat + 4 * k, 0, 4 * sizeof *dout->quat);
        memset(dout->color + k * dout->channels, 0,
               dout->channels * sizeof *dout->color);
        dout->opacity[k] = 0;
    }
}
