/* The Static Branch: a deformable plane of Gaussians facing the source
 * camera (Section 3.2, Eqs. of U, mu and the depth offset). */
#include "lib/avatar/static_branch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/avatar/coverage.h"
#include "lib/base/parallel.h"
#include "lib/base/slices.h"
#include "lib/base/neck_blend.h"
#include "lib/base/resample.h"
#include "lib/base/vec3.h"
#include "lib/photo/place.h"

/* Opacity logits fall by this much where the mesh covers the plane. */
#define COVERED 6.0f
/* What follows the head and what the shoulders, each half and twice:
 * tests/bench/README.md, "Shoulders".  Head units. */
#define NECK_SOFT 0.08f /* that much lower e times as likely the body's: 16 mm */
#define ASIDE 0.1f      /* 2 cm from the mesh skin is either's */
#define SPREAD 0.05f    /* 1 cm about (standard deviation) moves alike */
#define NECK_ENDS 0.01f /* likelier than that of either is certain */

/* ---- the branch -------------------------------------------------------- */

void static_branch_init(struct static_branch *b, struct params *ps,
                        const struct avatar_config *c)
{
    struct gaussian_head head = {.colors = c->channels,
                                 .position = GAUSSIAN_POSITION_DEPTH,
                                 .quirk_columns = c->public_quirks};

    memset(b, 0, sizeof *b);
    b->n = c->plane;
    b->count = b->n * b->n;
    b->feature = c->feature;
    b->prior = c->rgb_skip;
    b->inputs = c->feature + 2 + (b->prior ? STATIC_BRANCH_EXTRA : 0);
    if (c->init_width)
        plane_init_init(&b->init, ps, "init.", c->feature + 1, c->init_width);
    conv_decoder_init(&b->decoder, ps, "static.", b->inputs, c->static_width,
                      head);
}

/* Last layer a tenth as large; opaque, unrotated, as large as their
 * spacing asks for. */
void static_branch_init_weights(struct params *ps,
                                const struct avatar_config *c)
{
    const char *bias = "static.gaussian_conv.6.bias";
    size_t C = c->channels;

    branch_scale_tensor(ps, "static.gaussian_conv.6.weight", 0.1f);
    branch_set_bias(ps, bias, C, 1, 2.5f);
    branch_set_bias(ps, bias, C + 1, 3,
                    branch_scale_bias(2.0f / (float)c->plane, c->rgb_skip));
    branch_set_bias(ps, bias, C + 4, 1, 1);
}

int static_branch_plan(struct static_branch *b, struct nn_options opt,
                       struct error *err)
{
    size_t n2 = b->count, Cf = b->feature;
    const struct slice slices[] = {
        {&b->start.opacity, n2, false}, {&b->start.scale, 3 * n2, false},
        {&b->start.opacity_shift, n2, false},
        {&b->start.scale_shift, n2, false}, {&b->start.scale_max, n2, false},
        {&b->start.visible, n2, false},
        {&b->dinit_in, n2 * (Cf + 1), true}, {&b->delta, 2 * n2, false},
        {&b->U, 2 * n2, false}, {&b->dU, 2 * n2, true},
        {&b->pixel, 4 * n2, false}, {&b->dpixel, 4 * n2, true},
        {&b->din, n2 * b->inputs, true}, {&b->dsampled, n2 * Cf, true},
        {&b->logit, 3 * n2, false}, {&b->dlogit, 3 * n2, true},
        {&b->cell, n2, false},
        {&b->height, n2, false}, {&b->surface, n2, false},
        {&b->moving, n2, false},
        {&b->p_raw, n2, false}, {&b->p_shift, n2, false}, {&b->p, n2, false},
        {&b->dp, n2, true}, {&b->dvisible, n2, true}
    };

    if (slices_allocate(&b->block, slices, sizeof slices / sizeof *slices,
                        opt.mode != NN_INFER, err))
        return -1;
    if (conv_decoder_plan(&b->decoder, 1, b->n, b->n, opt, err))
        return -1;
    if (!b->init.width)
        return 0;
    /* what a network reads is other networks' memory at other times */
    nn_plan_init(&b->rows, opt);
    b->init_in = nn_plan_map(&b->rows, n2 * (Cf + 1));
    return plane_init_plan(&b->init, b->n, b->n, opt, err) ||
           nn_plan_finish(&b->rows, err) ? -1 : 0;
}

void static_branch_release(struct static_branch *b)
{
    plane_init_release(&b->init);
    conv_decoder_release(&b->decoder);
    nn_plan_release(&b->rows);
    free(b->block);
    memset(b, 0, sizeof *b);
}

/* ---- what the plane's cells lie on --------------------------------------- */

PARALLEL(static_branch_surface_part, k, const struct source_mesh *, mesh,
         struct static_branch *, b)
{
    const float h = mesh->cam[11] - mesh->depth[k];
    const float max = STATIC_BRANCH_HEIGHT;

    b->height[k] = isfinite(h) && mesh->coverage[k] >= COVERAGE_WHOLE
                       ? fminf(fmaxf(h, -max), max)
                       : 0;
}

/* Where the mesh lies over the plane, towards the camera; 0 beside it and on
 * its very outline, where a cell may have the colour of what is behind: at the
 * skin's depth, a turn to the side would show a line of specks. */
static void static_branch_surface(struct static_branch *b,
                                  const struct source_mesh *mesh)
{
    parallel_each(static_branch_surface_part, b->count, 1, mesh, b);
}

/* log how much likelier cell k is the body's than the head's by what it shows, times
 * the person's share of it (weight): cloth is the body's, hair the head's, and skin the
 * neck's near the mesh (`aside` cells), farther off a bare shoulder's. */
PARALLEL(static_branch_odds_part, k, float *, log_odds, float *, weight,
         const float *, aside, struct static_branch *, b,
         const struct source_mesh *, mesh, const struct material_colors *, colors)
{
    const float *pixel = b->pixel + 4 * k;
    const float distance = aside[k] * source_mesh_spacing(mesh, b->n);
    const float shoulder = distance / (distance + ASIDE);
    float odds[MATERIALS];

    material_odds(odds, pixel, colors);
    weight[k] = (b->prior ? fmaxf(pixel[3], 0) : 1) + 1e-4f;
    log_odds[k] = weight[k] * logf((odds[MATERIAL_CLOTH] + shoulder) /
                                   (odds[MATERIAL_HAIR] + 1 - shoulder));
}

/* Bayes' rule, the height over the shoulders being the prior: x stood at B^-1 x when
 * the neck was straight (back). */
PARALLEL(static_branch_neck_part, k, float *, neck, const float *, mean,
         const float *, back, const float *, log_odds, const float *, weight,
         float, top)
{
    const float *x = mean + 3 * k;
    const float y = back[4] * x[0] + back[5] * x[1] + back[6] * x[2] + back[7];
    const float share = 1 / (1 + expf((y - top) / NECK_SOFT -
                                      log_odds[k] / weight[k]));

    neck[k] = clampf((share - NECK_ENDS) / (1 - 2 * NECK_ENDS), 0, 1);
}

/* Neck blend weights (n*n) from where the cells lie on the surface and from what they
 * show.  b->U are the cells' centres, b->pixel what is there; mean (n*n,3) is used up. */
static void static_branch_neck(float *neck, float *mean,
                               const struct source_mesh *mesh,
                               const struct material_colors *colors,
                               struct static_branch *b)
{
    static const float straight[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    const struct neck_blend blend = head_avatar_neck(mesh->weights);
    const float spread = SPREAD / source_mesh_spacing(mesh, b->n);
    float *odds = b->logit, *weight = odds + b->count, *tmp = weight + b->count;
    float R[9], back[12];

    memset(neck, 0, b->count * sizeof *neck);
    if (!mesh->blend)
        return;
    for (int i = 0; i < 9; i++)
        R[i] = mesh->body[4 * (i % 3) + i / 3];
    neck_blend_body(back, blend.pivot, R, straight);
    for (size_t k = 0; k < b->count; k++)
        b->p[k] = 0.5f + 0.5f * b->height[k];
    static_branch_lift(mean, b->U, b->p, b->height, mesh->cam, mesh->normal,
                       b->count);
    coverage_distance(neck, mesh->coverage, b->n);
    parallel_each(static_branch_odds_part, b->count, 256, odds, weight, neck, b, mesh,
                  colors);
    coverage_blur(b->p_raw, odds, b->n, spread, tmp);
    coverage_blur(b->p_shift, weight, b->n, spread, tmp);
    parallel_each(static_branch_neck_part, b->count, 256, neck, mean, back, b->p_raw,
                  b->p_shift, blend.top);
}

/* b->moving, what may not be drawn: where the mesh moves. */
static void static_branch_mask(struct static_branch *b,
                               const struct source_mesh *mesh)
{
    for (size_t k = 0; k < b->count; k++)
        b->moving[k] = fminf(fmaxf(mesh->moving[k], 0), 1);
}

/* The maps of the cells, before they move. */
static void static_branch_map(float *neck, float *mean,
                              const struct source_picture *picture,
                              const struct source_mesh *mesh,
                              const struct material_colors *colors,
                              struct static_branch *b)
{
    static_branch_grid(b->U, b->n);
    if (b->prior)
        source_picture_sample(b->pixel, picture, b->U, b->count);
    static_branch_surface(b, mesh);
    static_branch_neck(neck, mean, mesh, colors, b);
    static_branch_mask(b, mesh);
}

/* Where a Gaussian has moved to: the cell it lies in now, and the surface there. */
PARALLEL(static_branch_locate_part, k, struct static_branch *, b)
{
    b->cell[k] = (uint32_t)source_mesh_cell(b->U + 2 * k, b->n);
    b->surface[k] = b->height[b->cell[k]];
}

/* ---- forward and backward ------------------------------------------------ */

PARALLEL(static_branch_deform_part, k, struct static_branch *, b,
         const float *, features, const struct source_mesh *, mesh, size_t, Cf)
{
    float *row = b->init_in + k * (Cf + 1);

    memcpy(row, features + k * Cf, Cf * sizeof *row);
    row[Cf] = mesh->coverage[k];
}

/* U = U_0 + Phi_init([F, C]). */
static void static_branch_deform(const float *features,
                                 const struct source_mesh *mesh,
                                 struct static_branch *b)
{
    size_t Cf = b->feature;

    if (b->uniform || !b->init.width)
        return;

    parallel_each(static_branch_deform_part, b->count, 1, b, features, mesh,
                  Cf);
    plane_init_forward(b->delta, b->init_in, &b->init);
    for (size_t k = 0; k < 2 * b->count; k++)
        b->U[k] += b->delta[k];
}

PARALLEL(static_branch_deform_backward_part, k, float *, dfeatures,
         struct static_branch *, b, size_t, Cf)
{
    for (size_t c = 0; c < Cf; c++)
        dfeatures[k * Cf + c] += b->dinit_in[k * (Cf + 1) + c];
}

/* Undo it; dfeatures is added to. */
static void static_branch_deform_backward(float *dfeatures,
                                          struct static_branch *b)
{
    size_t Cf = b->feature;

    if (b->uniform || !b->init.width)
        return;
    plane_init_backward(b->dinit_in, b->dU, &b->init);

    parallel_each(static_branch_deform_backward_part, b->count, 1, dfeatures, b,
                  Cf);
}

/* room (n,n): about how many cells a Gaussian is from where the picture shows
 * nobody (the chamfer distance, Borgefors 1986), n at most. */
static void static_branch_room(float *room, const struct static_branch *b)
{
    static const int to[4][2] = {{-1, 0}, {-1, -1}, {0, -1}, {1, -1}};
    const int n = (int)b->n, N = n * n;

    for (int k = 0; k < N; k++)
        room[k] = b->pixel[4 * k + 3] < 0.5f ? 0 : (float)n;
    for (int by = 1; by >= -1; by -= 2)
        for (int i = 0; i < N; i++) {
            const int k = by > 0 ? i : N - 1 - i, x = k % n, y = k / n;
            float min = room[k];

            for (int q = 0; q < 4; q++) {
                const int u = x + by * to[q][0], v = y + by * to[q][1];

                if (u < 0 || u >= n || v < 0 || v >= n)
                    continue;
                const float there = room[v * n + u] + (q % 2 ? 1.41f : 1);
                min = there < min ? there : min;
            }
            room[k] = min;
        }
}

PARALLEL(static_branch_limit_part, k, struct static_branch *, b, float, cell)
{
    float *max = b->start.scale_max + k;

    *max = fminf(cell * (2 * BRANCH_OVERLAP + *max / PLACE_REACH),
                 BRANCH_SCALE_MAX);
    b->start.scale_shift[k] = attribute_logit(BRANCH_OVERLAP * cell / *max);
}

/* scale_max, and the shift from there: a Gaussian ends where the person does, give
 * or take a cell.  Beyond the outline, where those on it have ended, one from
 * further in would draw what it has there. */
static void static_branch_limit(const struct source_mesh *mesh,
                                struct static_branch *b)
{
    static_branch_room(b->start.scale_max, b);
    parallel_each(static_branch_limit_part, b->count, 1, b,
                  source_mesh_spacing(mesh, b->n));
}

PARALLEL(static_branch_inputs_part, k, float *, rows, struct static_branch *, b,
         const float *, features, const struct source_mesh *, mesh,
         size_t, stride, size_t, Cf)
{
    float *row = rows + k * stride;
    const float *pixel = b->pixel + 4 * k;
    const size_t at = b->cell[k];

    grid_sample(row, features, b->U + 2 * k, 1, b->n, b->n, Cf, 1, false,
                RESAMPLE_BORDER);
    row[Cf] = b->U[2 * k];
    row[Cf + 1] = b->U[2 * k + 1];
    if (!b->prior)
        return;
    row[Cf + 2] = mesh->coverage[at];
    row[Cf + 3] = pixel[3];
    row[Cf + 4] = b->surface[k];
    row[Cf + 5] = isfinite(mesh->depth[at]) ? 1 : 0;
    for (int c = 0; c < 3; c++)
        b->logit[3 * k + c] = attribute_logit(pixel[c]);
    b->start.visible[k] = fminf(pixel[3], 1) * (1 - b->moving[at]);
    b->start.opacity_shift[k] = -COVERED * mesh->coverage[at];
    b->p_shift[k] = attribute_logit(0.5f + 0.5f * b->surface[k]);
}

/* The decoder's input rows [F at U, U, extras], and the prior. */
static void static_branch_inputs(const float *features,
                                 const struct source_mesh *mesh,
                                 struct static_branch *b)
{
    size_t Cf = b->feature, stride;
    float *rows = conv_decoder_rows(&stride, &b->decoder);

    parallel_each(static_branch_inputs_part, b->count, 1, rows, b, features,
                  mesh, stride, Cf);
}

PARALLEL(static_branch_inputs_backward_part, k, struct static_branch *, b,
         size_t, Cf)
{
    const float *row = b->din + k * b->inputs;

    memcpy(b->dsampled + k * Cf, row, Cf * sizeof *row);
    b->dU[2 * k] += row[Cf];
    b->dU[2 * k + 1] += row[Cf + 1];
    if (!b->prior)
        return;
    b->dpixel[4 * k + 3] =
        row[Cf + 3] + b->dvisible[k] * (1 - b->moving[b->cell[k]]);
    for (int c = 0; c < 3; c++)
        b->dpixel[4 * k + c] =
            attribute_logit_backward(b->dlogit[3 * k + c], b->pixel[4 * k + c]);
}

/* Gradients of the decoder's input rows into dU, dsampled and dpixel. */
static void static_branch_inputs_backward(struct static_branch *b)
{
    size_t Cf = b->feature;

    parallel_each(static_branch_inputs_backward_part, b->count, 1, b, Cf);
}

PARALLEL(static_branch_forward_part, k, struct static_branch *, b)
{
    b->p[k] = b->prior ? attribute_shift(b->p_raw[k], b->p_shift[k])
                       : b->p_raw[k];
}

/* Rows [F at U, U, extras] through Phi_S, lifted from the plane. */
void static_branch_forward(struct branch_set *out, const float *features,
                           const struct source_picture *picture,
                           const struct source_mesh *mesh,
                           const struct material_colors *colors,
                           struct static_branch *b)
{
    if (out->n == 0)
        return;
    static_branch_map(out->neck, out->mean, picture, mesh, colors, b);
    static_branch_deform(features, mesh, b);
    parallel_each(static_branch_locate_part, b->count, 1, b);
    if (b->prior && b->init.width)      /* they have moved */
        source_picture_sample(b->pixel, picture, b->U, b->count);
    if (b->prior)
        static_branch_limit(mesh, b);
    static_branch_inputs(features, mesh, b);
    struct gaussian_out raw = branch_decoder_out(out, &b->start, b->p_raw);
    conv_decoder_forward(&raw, NULL, mesh->normal,
                         b->prior ? b->logit : NULL, &b->decoder);
    branch_prior_forward(out, &b->start, b->prior);

    parallel_each(static_branch_forward_part, b->count, 1, b);
    static_branch_lift(out->mean, b->U, b->p, b->prior ? b->surface : NULL,
                       mesh->cam, mesh->normal, b->count);
    for (size_t k = 0; k < b->count; k++)
        out->seen[k] = b->prior && b->pixel[4 * k + 3] > 0
                     ? 1 - b->moving[b->cell[k]] : 0;
}

PARALLEL(static_branch_backward_part, k, struct static_branch *, b)
{
    b->dp[k] = attribute_shift_backward(b->dp[k], b->p_raw[k], b->p_shift[k]);
}

/* Reverse of static_branch_forward, line by line. */
void static_branch_backward(float *dfeatures, struct branch_set *dout,
                            const float *features,
                            const struct source_picture *picture,
                            const struct source_mesh *mesh,
                            struct static_branch *b)
{
    const size_t shifted = b->prior ? b->count : 0;

    if (dout->n == 0)
        return;
    memset(b->dU, 0, 2 * b->count * sizeof *b->dU);
    memset(b->dp, 0, b->count * sizeof *b->dp);
    static_branch_lift_backward(b->dU, b->dp, dout->mean,
                                b->prior ? b->surface : NULL, mesh->cam,
                                mesh->normal, b->count);

    parallel_each(static_branch_backward_part, shifted, 1, b);
    branch_prior_backward(dout, b->dvisible, &b->start, b->prior);
    struct gaussian_out draw = branch_attributes(dout, b->dp);
    conv_decoder_backward(b->din, NULL, b->prior ? b->dlogit : NULL, &draw,
                          mesh->normal, b->prior ? b->logit : NULL,
                          &b->decoder);
    static_branch_inputs_backward(b);
    if (b->prior)
        source_picture_sample_backward(b->dU, b->dpixel, picture, b->U,
                                       b->count);
    grid_sample_backward(dfeatures, b->dU, b->dsampled, features, b->U, 1,
                         b->n, b->n, b->feature, b->count, false,
                         RESAMPLE_BORDER);
    static_branch_deform_backward(dfeatures, b);
}
