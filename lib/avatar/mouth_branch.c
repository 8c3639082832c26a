/* The Mouth Interior Branch: a small grid of Gaussians behind the lips that
 * follows their centroid (Section 3.2). */
#include "lib/avatar/mouth_branch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/slices.h"
#include "lib/base/resample.h"

#define BACK_MAX 0.5f   /* what is behind the teeth is seen so well at most */
#define AROUND 20       /* the cells around one: the grid's side over this */
#define JAW_MM 4.5f     /* of the chin's way change what is between the lips */

/* ---- the equations ----------------------------------------------------- */

void mouth_branch_grid(float *g, float *uv, const float centre[3],
                       float radius, size_t K)
{
    for (size_t i = 0; i < K; i++)
        for (size_t j = 0; j < K; j++) {
            size_t k = i * K + j;

            uv[2 * k] = (float)(2 * j + 1) / (float)K - 1;
            uv[2 * k + 1] = 1 - (float)(2 * i + 1) / (float)K;
            g[3 * k] = centre[0] + radius * uv[2 * k];
            g[3 * k + 1] = centre[1] + radius * uv[2 * k + 1];
            g[3 * k + 2] = centre[2];
        }
}

float mouth_branch_cap(const struct head_mouth *m)
{
    return m->bowl + 0.5f * m->lip + MOUTH_BRANCH_EPS;
}

size_t mouth_branch_clamp(float *q, size_t N, float cap)
{
    size_t clamped = 0;

    for (size_t k = 0; k < N; k++) {
        float z = q[3 * k + 2], in = fminf(fmaxf(z, -cap), cap);

        clamped += in != z;
        q[3 * k + 2] = in;
    }
    return clamped;
}

/* The derivative of the clamp is 0 or 1. */
void mouth_branch_clamp_backward(float *dq, const float *raw, size_t N,
                                 float cap)
{
    for (size_t k = 0; k < N; k++)
        if (!(fabsf(raw[3 * k + 2]) <= cap))
            dq[3 * k + 2] = 0;
}

/* ---- the branch -------------------------------------------------------- */

void mouth_branch_init(struct mouth_branch *b, struct params *ps,
                       const struct avatar_config *c)
{
    struct gaussian_head head = {.colors = c->channels,
                                 .position = GAUSSIAN_POSITION_OFFSET,
                                 .quirk_columns = c->public_quirks};

    memset(b, 0, sizeof *b);
    b->K = c->mouth;
    b->count = b->K * b->K;
    b->n = c->plane;
    b->feature = c->feature;
    b->prior = c->rgb_skip;
    b->inputs = c->feature + 2 + (b->prior ? MOUTH_BRANCH_EXTRA : 0);
    conv_decoder_init(&b->decoder, ps, "mouth.", b->inputs, c->mouth_width,
                      head);
}

/* As the static branch's; without the prior also behind the lips. */
void mouth_branch_init_weights(struct params *ps,
                               const struct avatar_config *c)
{
    const char *bias = "mouth.gaussian_conv.6.bias";
    size_t C = c->channels;

    branch_scale_tensor(ps, "mouth.gaussian_conv.6.weight", 0.1f);
    branch_set_bias(ps, bias, C, 1, 2.5f);
    branch_set_bias(ps, bias, C + 1, 3,
                    branch_scale_bias(0.25f / (float)c->mouth, c->rgb_skip));
    branch_set_bias(ps, bias, C + 4, 1, 1);
    if (!c->rgb_skip)
        branch_set_bias(ps, bias, C + 10, 1, -0.06f);   /* 12 mm behind the
                                                         * lips */
}

int mouth_branch_plan(struct mouth_branch *b, struct nn_options opt,
                      struct error *err)
{
    size_t M = b->count;
    const struct slice slices[] = {
        {&b->grid, 3 * M, false}, {&b->uv, 2 * M, false},
        {&b->place, 2 * M, false}, {&b->sampled, M * b->feature, false},
        {&b->teeth, M * sizeof *b->teeth / sizeof(float), false},
        {&b->jaw, 3 * M, false}, {&b->pixel, 4 * M, false},
        {&b->more, 4 * M, false},
        {&b->visible, M, false}, {&b->reach, M, false},
        {&b->likeness, M, false}, {&b->around, M, false}, {&b->own, M, false},
        {&b->in, M * b->inputs, false},
        {&b->din, M * b->inputs, true}, {&b->logit, 3 * M, false},
        {&b->q, 3 * M, false}, {&b->dq, 3 * M, true}
    };

    if (slices_allocate(&b->block, slices, sizeof slices / sizeof *slices,
                        opt.mode != NN_INFER, err))
        return -1;
    b->dsampled = b->sampled;       /* the decoder's input has a copy */
    return conv_decoder_plan(&b->decoder, 1, b->K, b->K, opt, err);
}

void mouth_branch_release(struct mouth_branch *b)
{
    conv_decoder_release(&b->decoder);
    free(b->block);
    memset(b, 0, sizeof *b);
}

/* How much of cell k's place the source shows: 1 between open lips, 0 on the
 * lips and outside, and where the person ends. */
static float mouth_branch_opening(const struct mouth_branch *b, size_t k,
                                  float r)
{
    const float *uv = b->uv + 2 * k, half = 0.5f * b->lips.gap / r;
    float shape = uv[0] * uv[0] / 0.64f;

    if (half < 0.02f || shape >= 1)
        return 0;
    float edge = half * sqrtf(1 - shape);
    return b->pixel[4 * k + 3] *
           (1 - branch_ramp(fabsf(uv[1]), 0.5f * edge, edge + 1e-6f));
}

/* A cell in which the photograph shows something else, lips or their shadow,
 * is like the photograph only while the jaw is where it was; what is behind the
 * teeth shows a little more of itself for every millimetre. */
static float mouth_branch_reach(const struct teeth_cell *t, float mm,
                                float likeness)
{
    const float still = hypotf(t->jaw[1], t->jaw[2]) * JAW_MM * mm;

    if (t->layer == MOUTH_BACK)
        return still / (1 - fminf(likeness, BACK_MAX));
    return likeness < 0.99f ? still / (1 - likeness) : 0;
}

/* b->around from b->likeness: what most cells around are.  Lines between teeth
 * and what gums the photograph shows belong to teeth, though no generic tooth is
 * dark or red just there. */
static void mouth_branch_smooth_likeness(struct mouth_branch *b)
{
    const size_t K = b->K, R = K / AROUND;

    for (size_t k = 0; k < b->count; k++) {
        const size_t i = k / K, j = k % K;
        float sum = 0, n = 0;

        for (size_t y = i > R ? i - R : 0; y <= i + R && y < K; y++)
            for (size_t x = j > R ? j - R : 0; x <= j + R && x < K; x++) {
                if (b->teeth[y * K + x].layer != b->teeth[k].layer)
                    continue;
                sum += b->likeness[y * K + x];
                n++;
            }
        b->around[k] = branch_ramp(sum / n, 0.5f, 0.75f);
    }
}

/* How far the picture shows each cell, and its colour is the cell's; r: the
 * grid's radius. */
static void mouth_branch_judge(float r, struct mouth_branch *b)
{
    for (size_t k = 0; k < b->count; k++)
        b->likeness[k] = branch_likeness(b->pixel + 4 * k, b->teeth[k].color);
    mouth_branch_smooth_likeness(b);
    for (size_t k = 0; k < b->count; k++) {
        b->visible[k] = teeth_hidden(b->teeth, b->K, k)
                    ? 0 : mouth_branch_opening(b, k, r);
        b->own[k] = b->visible[k] * b->around[k];
    }
}

/* The prior: extra columns of the decoder's input, and the colours it starts
 * from; mm: a millimetre. */
static void mouth_branch_start(float r, float mm, struct mouth_branch *b)
{
    mouth_branch_judge(r, b);
    for (size_t k = 0; k < b->count; k++) {
        const float *pixel = b->pixel + 4 * k, *own = b->teeth[k].color;
        float *extra = b->in + (k + 1) * b->inputs - MOUTH_BRANCH_EXTRA;
        const float w = extra[0] = b->own[k];

        b->reach[k] = mouth_branch_reach(&b->teeth[k], mm, b->around[k]);
        extra[1] = b->lips.gap / r;
        for (int c = 0; c < 3; c++)
            b->logit[3 * k + c] = attribute_logit(w * pixel[c] +
                                                  (1 - w) * own[c]);
    }
}

/* Lips pressed to a point still get a grid of finite size. */
static float mouth_branch_radius(const struct mouth_branch *b)
{
    return fmaxf(b->lips.radius, 1e-3f);
}

/* Place and shape are the teeth's; so is the colour of what the source does
 * not show, and features beyond it are 0: decoders that saw most mouths closed
 * paint a torn veil there. */
static void mouth_branch_unseen(struct branch_set *out,
                                const struct mouth_branch *b)
{
    for (size_t k = 0; k < b->count; k++) {
        const struct teeth_cell *t = &b->teeth[k];
        float w = b->own[k], *color = out->color +
                                                     k * out->channels;

        for (size_t c = 0; c < out->channels; c++)
            color[c] = w * color[c] + (c < 3 ? (1 - w) * t->color[c] : 0);
        memcpy(out->scale + 3 * k, t->scale, sizeof t->scale);
        memcpy(out->quat + 4 * k, t->quat, sizeof t->quat);
        memcpy(out->mean + 3 * k, t->mean, sizeof t->mean);
        memcpy(b->jaw + 3 * k, t->jaw, sizeof t->jaw);
        out->opacity[k] = BRANCH_SOLID;
        out->seen[k] = b->visible[k];
    }
}

/* Reverse of mouth_branch_unseen, in place: of the decoder only colours are
 * left. */
static void mouth_branch_unseen_backward(struct branch_set *dout,
                                         const struct mouth_branch *b)
{
    const size_t C = dout->channels;

    for (size_t i = 0; i < b->count * C; i++)
        dout->color[i] *= b->own[i / C];
    memset(dout->scale, 0, 3 * b->count * sizeof *dout->scale);
    memset(dout->quat, 0, 4 * b->count * sizeof *dout->quat);
    memset(dout->opacity, 0, b->count * sizeof *dout->opacity);
    memset(b->dq, 0, 3 * b->count * sizeof *b->dq);
}

/* The teeth in place of the grid, the upper ones lifted, their canonical
 * coordinates and the picture there. */
static void mouth_branch_place(const struct source_picture *picture,
                               const float white[3], float r, float lift,
                               const struct source_mesh *mesh,
                               struct mouth_branch *b)
{
    struct head_mouth rest;

    head_mouth(&rest, mesh->head, mesh->rest);
    teeth_make(b->teeth, mesh->head, &rest, b->lips.chin, lift, b->K);
    for (size_t k = 0; k < b->count; k++) {
        const float *more = b->more + 4 * k;
        float *color = b->teeth[k].color;

        memcpy(b->grid + 3 * k, b->teeth[k].mean, sizeof b->teeth[k].mean);
        for (size_t c = 0; c < 3; c++)
            color[c] = white[c] * (color[c] + more[3] * (more[c] - color[c]));
        for (size_t c = 0; c < 2; c++)
            b->uv[2 * k + c] = (b->grid[3 * k + c] - b->lips.centre[c]) / r;
    }
    source_mesh_project(b->place, b->grid, b->count, mesh->cam);
    source_picture_sample(b->pixel, picture, b->place, b->count);
}

/* Generic teeth, or where the source shows the upper ones as long and as bright
 * as those; white: the light in the picture. */
static void mouth_branch_teeth(const struct source_picture *picture,
                               const float white[3], float r,
                               const struct source_mesh *mesh,
                               struct mouth_branch *b)
{
    float light[3] = {white[0], white[1], white[2]};

    mouth_branch_place(picture, white, r, 0, mesh, b);
    for (size_t k = 0; k < b->count; k++)
        b->visible[k] = mouth_branch_opening(b, k, r) *
                      branch_likeness(b->pixel + 4 * k, b->teeth[k].color);
    teeth_light(light, b->teeth, b->visible, b->pixel, b->K);
    const float lift = teeth_lift(b->teeth, b->visible, b->K);
    if (lift != 0)
        b->lift = lift;
    mouth_branch_place(picture, light, r, b->lift, mesh, b);
}

/* ---- further pictures ---------------------------------------------------- */

void mouth_branch_begin(struct mouth_branch *b)
{
    memset(b->more, 0, 4 * b->count * sizeof *b->more);
    b->lift = 0;
}

void mouth_branch_add(const struct source_picture *picture,
                      const struct source_mesh *mesh, const float white[3],
                      struct mouth_branch *b)
{
    head_mouth(&b->lips, mesh->head, mesh->posed);
    const float r = mouth_branch_radius(b);

    mouth_branch_teeth(picture, white, r, mesh, b);
    mouth_branch_judge(r, b);
    for (size_t k = 0; k < b->count; k++) {
        float *more = b->more + 4 * k;

        if (!(b->own[k] > more[3]))
            continue;
        for (size_t c = 0; c < 3; c++)
            more[c] = fminf(b->pixel[4 * k + c] / fmaxf(white[c], 1e-3f), 1);
        more[3] = b->own[k];
    }
}

/* The decoder's input rows [F at g, u, v]. */
static void mouth_branch_inputs(const float *features, struct mouth_branch *b)
{
    size_t Cf = b->feature;

    grid_sample(b->sampled, features, b->place, 1, b->n, b->n, Cf, b->count,
                false, RESAMPLE_BORDER);
    for (size_t k = 0; k < b->count; k++) {
        float *row = b->in + k * b->inputs;

        memcpy(row, b->sampled + k * Cf, Cf * sizeof *row);
        memcpy(row + Cf, b->uv + 2 * k, 2 * sizeof *row);
    }
}

/* Rows [F at g, u, v, extras] through Phi_M; mu = g + q. */
void mouth_branch_forward(struct branch_set *out, const float *features,
                          const struct source_picture *picture,
                          const struct source_mesh *mesh,
                          const float white[3], struct mouth_branch *b)
{
    head_mouth(&b->lips, mesh->head, mesh->posed);
    b->cap = mouth_branch_cap(&b->lips);
    b->clamped = 0;
    if (out->n == 0)
        return;
    float r = mouth_branch_radius(b);
    if (b->prior) {
        mouth_branch_teeth(picture, white, r, mesh, b);
    } else {
        mouth_branch_grid(b->grid, b->uv, b->lips.centre, r, b->K);
        source_mesh_project(b->place, b->grid, b->count, mesh->cam);
    }
    mouth_branch_inputs(features, b);
    if (b->prior)
        mouth_branch_start(r, 1e-3f * mesh->head->scale, b);
    struct gaussian_out raw = branch_attributes(out, b->q);
    conv_decoder_forward(&raw, b->in, mesh->normal,
                         b->prior ? b->logit : NULL, &b->decoder);
    memset(out->neck, 0, b->count * sizeof *out->neck);
    memset(out->seen, 0, b->count * sizeof *out->seen);
    if (b->prior) {
        mouth_branch_unseen(out, b);
        return;
    }
    memcpy(out->mean, b->q, 3 * b->count * sizeof *out->mean);
    b->clamped = mouth_branch_clamp(out->mean, b->count, b->cap);
    for (size_t i = 0; i < 3 * b->count; i++)   /* l_d - l_s comes later */
        out->mean[i] += b->grid[i];
}

/* g is a constant: gradients go to Phi_M and the features. */
void mouth_branch_backward(float *dfeatures, struct branch_set *dout,
                           const float *features,
                           const struct source_mesh *mesh,
                           struct mouth_branch *b)
{
    size_t Cf = b->feature;

    if (dout->n == 0)
        return;
    if (b->prior) {
        mouth_branch_unseen_backward(dout, b);
    } else {
        memcpy(b->dq, dout->mean, 3 * b->count * sizeof *b->dq);
        mouth_branch_clamp_backward(b->dq, b->q, b->count, b->cap);
    }
    struct gaussian_out draw = branch_attributes(dout, b->dq);
    conv_decoder_backward(b->din, NULL, NULL, &draw, mesh->normal,
                          b->prior ? b->logit : NULL, &b->decoder);
    for (size_t k = 0; k < b->count; k++)
        memcpy(b->dsampled + k * Cf, b->din + k * b->inputs,
               Cf * sizeof *b->dsampled);
    grid_sample_backward(dfeatures, NULL, b->dsampled, features, b->place, 1,
                         b->n, b->n, Cf, b->count, false, RESAMPLE_BORDER);
}
