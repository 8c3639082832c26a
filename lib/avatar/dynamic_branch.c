/* The Dynamic Branch: Gaussians on the vertices and edge midpoints of the
 * head mesh, which the driven mesh carries along (Section 3.2). */
#include "lib/avatar/dynamic_branch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/avatar/completion.h"
#include "lib/avatar/coverage.h"
#include "lib/avatar/disks.h"
#include "lib/avatar/eyes.h"
#include "lib/avatar/further.h"
#include "lib/avatar/lip_lining.h"
#include "lib/avatar/material.h"
#include "lib/avatar/relief.h"
#include "lib/avatar/tilt.h"
#include "lib/avatar/white_point.h"
#include "lib/base/gaussians.h"
#include "lib/base/parallel.h"
#include "lib/base/slices.h"
#include "lib/base/camera.h"
#include "lib/base/neck_blend.h"
#include "lib/base/resample.h"
#include "lib/base/vec3.h"

#define REACH 2.7f      /* the disks' standard deviations that may be seen: with 2 a
                         * seventh of them stood out before the background */
#define SEAM_MM 4.5f    /* the photograph is used for lips moved less than this
                         * from where it shows them */
#define ON_TEETH_MM 1.5f        /* the same where it shows teeth in their place */
/* Cosines between which the photograph is trusted where a surface lies, and wholly:
 * 1 and 8 mm from the outline of a head 75 mm in radius; with its colours elsewhere,
 * too, hair's and cloth's from there on, skin's, which is darker there and has hair
 * beside it, from 6 mm, as much as the pose may be off (SOURCE_MESH_OFF), and 15.
 * tests/bench/README.md, "How long the photograph holds". */
#define SIDEWAYS 0.15f
#define SQUARE 0.45f
#define SKIN_SIDEWAYS 0.4f
#define SKIN_SQUARE 0.6f
#define STEEP 1.98f     /* a surface rises by so much where trust is whole */
#define HELD 0.6f       /* where the photograph is trusted a surface fades by so
                         * much less as it turns: it is gone not at 2.5 but 4.8
                         * times, where a pixel of 0.5 mm is nearly as coarse as
                         * the mesh, of a point each 2.8 mm (gaussian_visible) */
#define SLACK 0.03f     /* a vertex is visible if no further behind the surface,
                         * head units */

/* ---- the branch -------------------------------------------------------- */

void dynamic_branch_init(struct dynamic_branch *b, struct params *ps,
                         const struct avatar_config *c, const struct head *h,
                         const struct densify *d)
{
    struct gaussian_head points = {.colors = c->channels,
                                   .colors_only = c->rgb_skip,
                                   .position = GAUSSIAN_POSITION_NONE,
                                   .quirk_rotation = c->public_quirks};
    size_t rows[2] = {h->V, c->vertex_width};

    memset(b, 0, sizeof *b);
    b->ps = ps;
    b->dense = d;
    b->count = d->V + d->E;
    b->n = c->plane;
    b->feature = c->feature;
    b->width = c->vertex_width;
    b->prior = c->rgb_skip;
    b->inputs = c->vertex_width + c->feature +
                (b->prior ? DYNAMIC_BRANCH_EXTRA : 0);
    b->head_base = params_add(ps, "dynamic.head_base", 2, rows, PARAM_NORMAL,
                              0.1f);
    mlp_decoder_init(&b->decoder, ps, "dynamic.", b->inputs, c->dynamic_width,
                     c->dynamic_hidden, points);
}

/* Last layers a tenth as large; opaque, unrotated, for a spacing of 4 mm, where
 * the decoder has a say in these. */
void dynamic_branch_init_weights(struct params *ps)
{
    branch_scale_tensor(ps, "dynamic.color_layers.2.weight", 0.1f);
    branch_scale_tensor(ps, "dynamic.opacity_layers.2.weight", 0.1f);
    branch_scale_tensor(ps, "dynamic.scale_layers.2.weight", 0.1f);
    branch_scale_tensor(ps, "dynamic.rotation_layers.2.weight", 0.1f);
    branch_set_bias(ps, "dynamic.opacity_layers.2.bias", 0, 1, 2.5f);
    branch_set_bias(ps, "dynamic.scale_layers.2.bias", 0, 3,
                    branch_scale_bias(0.02f, false));
    branch_set_bias(ps, "dynamic.rotation_layers.2.bias", 0, 1, 1);
}

int dynamic_branch_plan(struct dynamic_branch *b, size_t points,
                        struct nn_options opt, struct error *err)
{
    size_t D = b->count;
    const struct slice slices[] = {
        {&b->verts, 3 * D, false}, {&b->place, 2 * D, false},
        {&b->normals, 3 * D, false}, {&b->seen, D, false},
        {&b->facing, D, false},
        {&b->spacing, D, false}, {&b->pixel, 4 * D, false},
        {&b->din, D * b->inputs, true},
        {&b->logit, 3 * D, false}, {&b->trust, D, false},
        {&b->held, D, false}, {&b->as, MATERIALS * D, false},
        {&b->chance, MATERIALS * D, false}, {&b->hull, D, false},
        {&b->seam, D, false}, {&b->on_teeth, D, false},
        {&b->first, 4 * D, false}, {&b->more, FURTHER_SUMS * D, false}
    };

    if (slices_allocate(&b->block, slices, sizeof slices / sizeof *slices,
                        opt.mode != NN_INFER, err))
        return -1;
    /* what is not kept is networks' memory at other times */
    nn_plan_init(&b->rows, opt);
    b->tmp = nn_plan_map(&b->rows, COMPLETION_SCRATCH(D));
    b->in = nn_plan_map(&b->rows, D * b->inputs);
    b->dsampled = b->sampled = nn_plan_map(&b->rows, D * b->feature);
    b->dh = b->h = nn_plan_map(&b->rows, D * b->width);     /* in has copies */
    return mlp_decoder_plan(&b->decoder, 1, points, opt, err) ||
           nn_plan_finish(&b->rows, err) ? -1 : 0;
}

void dynamic_branch_release(struct dynamic_branch *b)
{
    mlp_decoder_release(&b->decoder);
    nn_plan_release(&b->rows);
    free(b->block);
    memset(b, 0, sizeof *b);
}

/* n.v of densified vertex k: cosine between normal and the way to the
 * camera. */
static float dynamic_branch_facing(const struct dynamic_branch *b, size_t k,
                                   const float eye[3])
{
    const float *x = b->verts + 3 * k, *n = b->normals + 3 * k;
    float v[3], dot = 0, len = 1e-12f;

    for (int c = 0; c < 3; c++) {
        v[c] = eye[c] - x[c];
        dot += v[c] * n[c];
        len += v[c] * v[c];
    }
    return dot / sqrtf(len);
}

/* Geometry of the densified source: vertices, normals, spacing, places. */
static void dynamic_branch_geometry(const struct source_mesh *mesh,
                                    struct dynamic_branch *b)
{
    densify_forward(b->verts, mesh->posed, b->dense, 3);
    if (mesh->blend)
        neck_blend_points(b->verts, b->verts, mesh->weights->neck, b->count,
                          mesh->body);
    densify_forward(b->normals, mesh->normals, b->dense, 3);
    densify_spacing(b->spacing, mesh->verts, b->dense);
    b->lid = mesh->weights->lid;
    b->fold = mesh->weights->fold;
    memcpy(b->seam, mesh->weights->seam, b->count * sizeof *b->seam);
    eyes_find_shut(b->shut, mesh->posed, mesh->rest, mesh->head);
    if (b->prior)
        eyes_stretch(b->spacing, b->shut, mesh->weights);
    source_mesh_project(b->place, b->verts, b->count, mesh->cam);
}

/* Whether the mesh, as the source's camera sees it, lies before a point at
 * place (2) of depth z. */
static bool dynamic_branch_is_occluded(const struct source_mesh *mesh,
                                       const float place[2], float z)
{
    return mesh->depth[source_mesh_cell(place, mesh->n)] < z + SLACK;
}

PARALLEL(dynamic_branch_hull_part, k, struct dynamic_branch *, b,
         const struct source_mesh *, mesh,
         const struct source_picture *, picture, float, scale)
{
    const float *p = b->place + 2 * k, r = scale * b->spacing[k];
    const float at[8] = { p[0] - r, p[1],     p[0] + r, p[1],
                          p[0],     p[1] - r, p[0],     p[1] + r };
    const float *x = b->verts + 3 * k, *cam = mesh->cam;
    const float z = cam[8] * x[0] + cam[9] * x[1] + cam[10] * x[2] + cam[11];
    float rgba[16], min = 1;

    source_picture_sample(rgba, picture, at, 4);
    for (int i = 0; i < 4; i++)
        min = dynamic_branch_is_occluded(mesh, at + 2 * i, z)
                    ? fminf(min, rgba[4 * i + 3])
                    : 0;
    b->hull[k] = branch_ramp(min, 0.5f, 0.95f);
}

/* hull: the least matte around every densified vertex, within the reach of a
 * hidden Gaussian, or 0 where the mesh does not cover all of that: there the
 * Gaussian would stand out beside the face (a visual hull of one view,
 * Laurentini 1994). */
static void dynamic_branch_hull(const struct source_picture *picture,
                                const struct source_mesh *mesh,
                                struct dynamic_branch *b)
{
    const float scale = REACH * BRANCH_OVERLAP * CAMERA_FOCAL /
                        fmaxf(mesh->cam[11], CAMERA_NEAR);

    parallel_each(dynamic_branch_hull_part, b->count, 1, b, mesh, picture,
                  scale);
}

/* Lips that lie on teeth in the picture do not have those colours. */
static void dynamic_branch_uncover_teeth(const struct source_mesh *mesh,
                                         struct dynamic_branch *b)
{
    lip_lining_on_teeth(b->on_teeth, b->pixel, mesh, b->white, b->dense,
                        b->tmp);
    for (size_t k = 0; k < b->count; k++) {
        b->seam[k] = fmaxf(b->seam[k], b->on_teeth[k]);
        b->trust[k] *= 1 - b->on_teeth[k];
        b->held[k] *= 1 - b->on_teeth[k];
    }
}

PARALLEL(dynamic_branch_start_part, k, struct dynamic_branch *, b, float *, eye,
         float *, rgb, const struct source_mesh *, mesh)
{
    const float *pixel = b->pixel + 4 * k;
    float *extra = b->in + (k + 1) * b->inputs - DYNAMIC_BRANCH_EXTRA;
    float nv = dynamic_branch_facing(b, k, eye), matte = pixel[3];

    b->facing[k] = extra[0] = nv;
    extra[1] = b->seen[k];
    extra[2] = b->seen[k] * branch_ramp(nv, 0.05f, 0.4f);
    extra[3] = matte;
    b->trust[k] *= b->seen[k] * branch_ramp(matte, 0.5f, 0.9f) *
                  (1 - b->lid[k]) * (1 - mesh->weights->lining[k]) *
                  (1 - b->seam[k]) * (1 - b->fold[k]);
    b->held[k] = b->trust[k] * branch_ramp(nv, SIDEWAYS, SQUARE);
    b->trust[k] *= branch_ramp(nv, SKIN_SIDEWAYS, SKIN_SQUARE);
    b->trust[k] += (1 - b->chance[MATERIAL_SKIN * b->count + k]) *
                   (b->held[k] - b->trust[k]);
    memcpy(rgb + 3 * k, pixel, 3 * sizeof *rgb);
}

PARALLEL(dynamic_branch_logit_part, i, float *, rgb)
{
    rgb[i] = attribute_logit(rgb[i]);
}

/* How far Gaussian k is on the side of the head that the source shows. */
static float dynamic_branch_front(const struct dynamic_branch *b, size_t k)
{
    return b->seen[k] * branch_ramp(b->facing[k], -0.4f, -0.1f);
}

/* What the picture shows of every densified vertex: visibility, coverage and
 * matte, into the extra columns of the decoder's input; colours, trust in them
 * (none where a nearer surface is as close as the pose may be off) and shifts. */
static void dynamic_branch_observe(const struct source_picture *picture,
                                   const struct source_mesh *mesh,
                                   struct dynamic_branch *b)
{
    const struct white_point_colors seen = {b->pixel, b->trust, b->tmp};
    const struct material_share all = material_all(mesh->weights);
    float eye[3], *rgb = b->logit;

    material_expect(b->chance, &all, mesh->weights, b->dense);
    camera_origin(eye, mesh->cam);
    coverage_seen(b->seen, b->verts, b->count, mesh->depth, mesh->n,
                  mesh->cam, SLACK);
    coverage_seen(b->trust, b->verts, b->count, mesh->near, mesh->n, mesh->cam,
                  SLACK + STEEP * SOURCE_MESH_OFF);
    for (size_t k = 0; k < b->count; k++)
        if (!source_picture_contains(picture, b->place + 2 * k))
            b->seen[k] = b->trust[k] = 0;
    eyes_hide(b->seen, b->shut, mesh->weights);
    source_picture_sample(b->pixel, picture, b->place, b->count);

    parallel_each(dynamic_branch_start_part, b->count, 1, b, eye, rgb, mesh);
    white_point(b->white, &seen, mesh->head);
    dynamic_branch_uncover_teeth(mesh, b);
}

void dynamic_branch_begin(const struct source_picture *picture,
                          const struct source_mesh *mesh,
                          struct dynamic_branch *b)
{
    dynamic_branch_geometry(mesh, b);
    dynamic_branch_observe(picture, mesh, b);
    for (size_t k = 0; k < b->count; k++) {
        memcpy(b->first + 4 * k, b->pixel + 4 * k, 3 * sizeof *b->first);
        b->first[4 * k + 3] = b->trust[k];
    }
    memset(b->more, 0, FURTHER_SUMS * b->count * sizeof *b->more);
    b->has_more = true;
}

void dynamic_branch_relief(float *relief, bool more,
                           const struct source_picture *picture,
                           const struct source_mesh *mesh,
                           struct dynamic_branch *b)
{
    const struct white_point_colors seen = {b->pixel, b->trust, b->tmp};
    const struct relief_work work = {b->colors, b->likelihood, b->as,
                                     b->tmp + b->count};
    float *front = b->tmp;

    dynamic_branch_geometry(mesh, b);
    dynamic_branch_observe(picture, mesh, b);
    if (!more)
        relief_find(relief, &work, &seen, b->held, picture, mesh, b->dense);
    for (size_t v = 0; v < b->dense->V; v++)
        front[v] = dynamic_branch_front(b, v);
    relief_limit(relief, front, picture, mesh);
}

void dynamic_branch_meet(float *relief, const struct source_picture *picture,
                         const struct source_mesh *mesh,
                         struct dynamic_branch *b)
{
    float eye[3], *rim = b->tmp;

    dynamic_branch_geometry(mesh, b);
    camera_origin(eye, mesh->cam);
    for (size_t v = 0; v < b->dense->V; v++)
        rim[v] = 1 - branch_ramp(fabsf(dynamic_branch_facing(b, v, eye)),
                                 SIDEWAYS, SQUARE);
    relief_meet(relief, rim, b->as + MATERIAL_HAIR * b->count, b->colors, picture,
                mesh, b->dense, rim + b->dense->V);
}

PARALLEL(dynamic_branch_relight_part, k, float *, color, size_t, stride,
         const float *, from, const float *, to,
         const struct dynamic_branch *, b)
{
    float n[3];

    lip_lining_bend(n, b->normals + 3 * k, b->seam[k]);
    const float gain = sqrtf(gaussian_light(n, to) / gaussian_light(n, from));

    for (size_t c = stride * k; c < stride * k + 3; c++)
        color[c] *= gain;
}

/* color (D,stride: red, green, blue and others) of a head that light `from` falls
 * on, (3) in its frame, as under light `to`. */
static void dynamic_branch_relight(float *color, size_t stride,
                                   const float from[3], const float to[3],
                                   const struct dynamic_branch *b)
{
    parallel_each(dynamic_branch_relight_part, b->count, 1, color, stride, from,
                  to, b);
}

void dynamic_branch_add(const struct source_picture *picture,
                        const struct source_mesh *mesh, const float light[3],
                        struct dynamic_branch *b)
{
    const struct further_picture p = {b->pixel, b->trust, b->facing};
    float gain[3];

    dynamic_branch_geometry(mesh, b);
    dynamic_branch_observe(picture, mesh, b);
    dynamic_branch_relight(b->pixel, 4, light, b->light, b);
    further_gain(gain, &p, b->first, b->count);
    further_add(b->more, &p, gain, b->count);
}

PARALLEL(dynamic_branch_log_part, i, float *, rgb)
{
    rgb[i] = log1pf(rgb[i] / SRGB_DARK);
}

PARALLEL(dynamic_branch_exp_part, i, float *, rgb)
{
    rgb[i] = fmaxf(SRGB_DARK * expm1f(rgb[i]), 0);
}

/* rgb (D,3), the picture's colours, completed without the light on them: it
 * falls otherwise on what the source's camera does not see.  By their logarithms,
 * since what is left of light and shade multiplies them, too. */
static void dynamic_branch_complete(float *rgb, const struct source_mesh *mesh,
                                    struct dynamic_branch *b)
{
    static const float none[3] = {0};

    dynamic_branch_relight(rgb, 3, b->light, none, b);
    parallel_each(dynamic_branch_log_part, 3 * b->count, 1, rgb);
    completion_solve(rgb, b->as, b->chance, mesh->weights->mirror, b->dense,
                     b->tmp);
    parallel_each(dynamic_branch_exp_part, 3 * b->count, 1, rgb);
    dynamic_branch_relight(rgb, 3, none, b->light, b);
    for (size_t i = 0; i < 3 * b->count; i++)
        rgb[i] = fminf(rgb[i], 1);
}

/* The prior: what the picture shows, and the colours that go on from it. */
static void dynamic_branch_start(const struct source_picture *picture,
                                 const struct source_mesh *mesh,
                                 struct dynamic_branch *b)
{
    const struct eyes_photo photo = {b->pixel, b->trust, b->white};
    const struct white_point_colors seen = {b->pixel, b->trust, b->tmp};
    float *rgb = b->logit;

    dynamic_branch_observe(picture, mesh, b);
    dynamic_branch_hull(picture, mesh, b);
    if (b->has_more)
        further_take(b->pixel, b->trust, rgb, b->facing, b->more, b->count);
    material_layers(b->colors, b->as, b->chance, b->tmp + b->count, b->likelihood,
                    &seen, b->held, mesh->weights, b->dense);
    dynamic_branch_complete(rgb, mesh, b);
    for (size_t i = 0; i < 3 * b->count; i++) {
        const size_t k = i / 3;
        float went_on = 0;

        for (size_t m = 0; m < MATERIALS; m++)
            went_on += b->chance[m * b->count + k] * b->as[m * b->count + k];

        rgb[i] += (b->trust[k] - went_on) * (b->pixel[4 * k + i % 3] - rgb[i]);
    }
    eyes_paint_lids(rgb, &photo, mesh->weights, b->tmp);
    lip_lining_paint(rgb, b->seam, b->normals, b->white, b->count);
    eyes_paint_balls(rgb, b->shut, &photo, mesh->weights, b->tmp);

    parallel_each(dynamic_branch_logit_part, 3 * b->count, 1, rgb);
}

/* How far the photograph says what is to be seen where Gaussian k is: the side
 * of the head that it shows, and, of those behind, what would stand out beside
 * the person or the mesh.  There it shows nobody, or hair. */
static float dynamic_branch_seen(const struct dynamic_branch *b, size_t k)
{
    const float front = dynamic_branch_front(b, k);

    return front + (1 - front) * (1 - b->hull[k]);
}

PARALLEL(dynamic_branch_inputs, k, struct dynamic_branch *, b)
{
    float *row = b->in + k * b->inputs;

    memcpy(row, b->h + k * b->width, b->width * sizeof *row);
    memcpy(row + b->width, b->sampled + k * b->feature,
           b->feature * sizeof *row);
}

/* Rows [h_k, d_k, extras] through Phi_D; the centre is the vertex. */
void dynamic_branch_forward(struct branch_set *out, const float *features,
                            const struct source_picture *picture,
                            const struct source_mesh *mesh,
                            struct dynamic_branch *b)
{
    size_t width = b->width, Cf = b->feature;

    if (out->n == 0)
        return;
    dynamic_branch_geometry(mesh, b);
    /* d_k = GridSample(F, p_k); h_k of a midpoint is the mean of its ends */
    grid_sample(b->sampled, features, b->place, 1, b->n, b->n, Cf, b->count,
                false, RESAMPLE_BORDER);
    densify_forward(b->h, param_w(b->ps, b->head_base), b->dense, width);
    parallel_each(dynamic_branch_inputs, b->count, 1, b);
    if (b->prior)
        dynamic_branch_start(picture, mesh, b);
    struct gaussian_out attributes = branch_attributes(out, NULL);
    mlp_decoder_forward(&attributes, b->in, mesh->normal,
                        b->prior ? b->logit : NULL, &b->decoder);
    if (b->prior)
        disks_lay(out, mesh, b);
    /* mu_k = densified vertex */
    memcpy(out->mean, b->verts, 3 * out->n * sizeof *out->mean);
    for (size_t k = 0; k < out->n; k++) {
        out->neck[k] = mesh->blend ? mesh->weights->neck[k] : 0;
        out->seen[k] = b->prior ? dynamic_branch_seen(b, k) : 0;
    }
    if (b->prior)
        lip_lining_shade(out, b->verts, mesh, b->white);
}

PARALLEL(dynamic_branch_inputs_backward, k, struct dynamic_branch *, b)
{
    const float *row = b->din + k * b->inputs;

    memcpy(b->dh + k * b->width, row, b->width * sizeof *row);
    memcpy(b->dsampled + k * b->feature, row + b->width,
           b->feature * sizeof *row);
}

/* Vertices are constants: gradients go to Phi_D, h_k and the features. */
void dynamic_branch_backward(float *dfeatures, struct branch_set *dout,
                             const float *features,
                             const struct source_mesh *mesh,
                             struct dynamic_branch *b)
{
    size_t width = b->width, Cf = b->feature;

    if (dout->n == 0)
        return;
    if (b->prior) {
        lip_lining_shade_backward(dout, mesh);
        disks_lay_backward(dout, b);
    }
    struct gaussian_out attributes = branch_attributes(dout, NULL);
    mlp_decoder_backward(b->din, NULL, &attributes, mesh->normal,
                         b->prior ? b->logit : NULL, &b->decoder);
    memset(b->dh, 0, b->count * width * sizeof *b->dh);
    memset(b->dsampled, 0, b->count * Cf * sizeof *b->dsampled);
    parallel_each(dynamic_branch_inputs_backward, dout->n, 1, b);
    densify_backward(param_g(b->ps, b->head_base), b->dh, b->dense, width);
    grid_sample_backward(dfeatures, NULL, b->dsampled, features, b->place, 1,
                         b->n, b->n, Cf, b->count, false, RESAMPLE_BORDER);
}

void dynamic_branch_tilt(float *tilt, const float *neck, size_t n,
                         const struct source_mesh *mesh,
                         const struct dynamic_branch *b)
{
    const float *cam = mesh->cam;

    for (size_t k = 0; k < n; k++) {
        const float *to = b->normals + 3 * k;
        const float front = dynamic_branch_front(b, k);
        const float hold = 1 - HELD * b->held[k];
        const float by = (1 - neck[k]) / fmaxf(b->facing[k], 1 / TILT_STEEPEST);

        for (size_t c = 0; c < 2; c++) {
            const float *row = cam + 4 * c;
            const float own = by * (row[0] * to[0] + row[1] * to[1] +
                                    row[2] * to[2]);

            tilt[2 * k + c] = front * hold * tilt[2 * k + c] +
                              (1 - front) * own;
        }
    }
}

void dynamic_branch_reach(float *reach, size_t n,
                          const struct source_mesh *mesh,
                          const struct dynamic_branch *b)
{
    const float closed = lip_lining_closed(mesh);

    for (size_t k = 0; k < n; k++) {
        const float seam = mesh->weights->lining[k] > 0 ? 1
                         : fmaxf(b->seam[k], closed * mesh->weights->crease[k]);

        reach[k] = mesh->weights->reach[k];
        if (seam > 0.1f && reach[k] == 0)
            reach[k] = fminf(SEAM_MM / seam, ON_TEETH_MM /
                             fmaxf(b->on_teeth[k], 1e-3f)) *
                       1e-3f * mesh->head->scale;
    }
}
