/* The Static Branch: a deformable plane of Gaussians facing the source
 * camera. */
#include <math.h>
#include <string.h>

#include "lib/avatar/branches.h"
#include "lib/avatar/coverage.h"
#include "lib/geom/camera.h"
#include "lib/geom/resample.h"

/* Opacity logits fall by this much where the mesh covers the plane. */
#define COVERED 6.0f
/* Standard deviation of a Gaussian over the distance to the next one. */
#define OVERLAP 0.6f
/* The rim that stays along the mesh's outline: cells, and head units (24 mm)
 * behind the skin. */
#define RIM 5.0f
#define BEHIND 0.12f
#define OUTLINE 0.97f   /* a cell that the mesh covers less of lies on it */

void static_grid(float *U0, size_t n)
{
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++) {
            U0[2 * (i * n + j)] = (float)(2 * j + 1) / (float)n - 1;
            U0[2 * (i * n + j) + 1] = (float)(2 * i + 1) / (float)n - 1;
        }
}

void static_normal(float normal[3], const float cam[12])
{
    for (int i = 0; i < 3; i++)
        normal[i] = -cam[8 + i];
}

void static_lift(float *mu, const float *U, const float *p,
                 const float *surface, const float cam[12],
                 const float normal[3], size_t N)
{
    float o[3];

    camera_origin(o, cam);
    for (size_t k = 0; k < N; k++) {
        float rise = surface ? surface[k] : 0;
        /* x/z and y/z of the ray: NDC over the focal length; its camera depth
         * at the plane is t_z, so d_s r_k = depth (x/z, y/z, 1) turned into
         * the head's frame */
        float depth = cam[11] - rise;
        float x = U[2 * k] / CAMERA_FOCAL, y = U[2 * k + 1] / CAMERA_FOCAL;

        for (int i = 0; i < 3; i++) {
            float ray = cam[i] * x + cam[4 + i] * y + cam[8 + i];

            mu[3 * k + i] = o[i] + depth * ray +
                            (2 * p[k] - 1 - rise) * normal[i];
        }
    }
}

void static_lift_backward(float *dU, float *dp, const float *dmu,
                          const float *surface, const float cam[12],
                          const float normal[3], size_t N)
{
    for (size_t k = 0; k < N; k++) {
        const float *d = dmu + 3 * k;
        float depth = cam[11] - (surface ? surface[k] : 0);

        /* mu = o + depth R^T (U/f, 1) + (2p - 1 - rise) n */
        for (int c = 0; c < 2; c++)
            dU[2 * k + c] += depth / CAMERA_FOCAL *
                             (cam[4 * c] * d[0] + cam[4 * c + 1] * d[1] +
                              cam[4 * c + 2] * d[2]);
        dp[k] += 2 * (normal[0] * d[0] + normal[1] * d[1] +
                      normal[2] * d[2]);
    }
}

size_t static_inputs(const struct avatar_config *c)
{
    return c->feature + 2 + (c->rgb_skip ? AVATAR_STATIC_EXTRA : 0);
}

/* U = U_0 + Phi_init([F, C]). */
static void deform(struct avatar *a)
{
    struct avatar_scratch *s = a->scratch;
    size_t Cf = s->Cf;

    static_grid(s->U, s->n);
    if (a->without & WITHOUT_DEFORM)
        return;
    for (size_t k = 0; k < s->n2; k++) {
        float *row = s->init_in + k * (Cf + 1);

        memcpy(row, s->features + k * Cf, Cf * sizeof *row);
        row[Cf] = s->coverage[k];
    }
    plane_init_forward(s->delta, s->init_in, &a->init);
    for (size_t k = 0; k < 2 * s->n2; k++)
        s->U[k] += s->delta[k];
}

/* What the mesh covers (s->cover) and what of it moves (s->held) is the
 * dynamic branch's, but for a rim along the mesh's outline, which goes behind
 * the skin: what a turn of the head uncovers there must not be a hole. */
static void keep_rim(struct avatar_scratch *s)
{
    coverage_blur(s->cover, s->coverage, s->n, RIM, s->raster);
    for (size_t k = 0; k < s->n2; k++) {
        float inside = fminf(fmaxf((s->cover[k] - 0.75f) / 0.2f, 0), 1);

        s->cover[k] = s->coverage[k] * inside;
        /* interpolation may pass its ends by a rounding */
        s->held[k] = inside * fminf(fmaxf(s->held[k], 0), 1);
        s->surface[k] -= BEHIND * (s->coverage[k] - s->cover[k]);
    }
}

/* Where the mesh lies over the plane, towards the camera; 0 beside it and on
 * its very outline, where a cell may have the colour of what is behind: at the
 * skin's depth, a turn to the side would show a line of specks. */
static void surface_height(struct avatar_scratch *s)
{
    for (size_t k = 0; k < s->n2; k++) {
        float h = s->cam[11] - s->zbuffer[k];

        s->surface[k] = isfinite(h) && s->coverage[k] >= OUTLINE
                      ? fminf(fmaxf(h, -0.9f), 0.9f) : 0;
    }
}

/* The decoder's input rows [F at U, U, extras], and the starting values. */
static void decoder_inputs(struct avatar *a)
{
    struct avatar_scratch *s = a->scratch;
    size_t in = static_inputs(&a->config), Cf = s->Cf, g = a->first[1];
    float cell = 2.0f / (float)s->n * s->cam[11] / CAMERA_FOCAL;
    float size_shift = attribute_logit(OVERLAP * cell / BRANCH_SCALE_MAX);

    for (size_t k = 0; k < s->n2; k++) {
        float *row = s->static_in + k * in;
        const float *pixel = s->sample + 4 * k;

        memcpy(row, s->resampled + k * Cf, Cf * sizeof *row);
        row[Cf] = s->U[2 * k];
        row[Cf + 1] = s->U[2 * k + 1];
        if (!a->config.rgb_skip)
            continue;
        row[Cf + 2] = s->coverage[k];
        row[Cf + 3] = pixel[3];
        row[Cf + 4] = s->surface[k];
        row[Cf + 5] = isfinite(s->zbuffer[k]) ? 1 : 0;
        for (int c = 0; c < 3; c++)
            s->static_logit[3 * k + c] = attribute_logit(pixel[c]);
        s->matte[g + k] = fminf(pixel[3], 1) * (1 - s->held[k]);
        s->opacity_shift[g + k] = -COVERED * s->cover[k];
        s->scale_shift[g + k] = size_shift;
        s->p_shift[k] = attribute_logit(0.5f + 0.5f * s->surface[k]);
    }
}

/* Weights of the bending, from where the uniform grid lies on the surface: a
 * point that is all shoulders stood at B^-1 x when the neck was straight. */
static void bend_plane(struct avatar *a)
{
    struct avatar_scratch *s = a->scratch;
    size_t g = a->first[BRANCH_STATIC];
    float R[9], body[12], back[12], *mu = s->mean + 3 * g;

    if (a->without & WITHOUT_BEND)
        return;
    bend_body(body, a->bend.pivot, avatar_upright, s->cam);
    for (int i = 0; i < 9; i++)
        R[i] = body[4 * (i % 3) + i / 3];
    const float straight[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    bend_body(back, a->bend.pivot, R, straight);
    static_grid(s->U, s->n);
    for (size_t k = 0; k < s->n2; k++)
        s->p[k] = 0.5f + 0.5f * s->surface[k];
    static_lift(mu, s->U, s->p, s->surface, s->cam, a->normal, s->n2);
    for (size_t k = 0; k < s->n2; k++) {
        const float *x = mu + 3 * k;
        float y = back[4] * x[0] + back[5] * x[1] + back[6] * x[2] + back[7];

        s->bend[g + k] = bend_weight(&a->bend, 0.5f * (x[1] + y));
    }
}

void static_bake(struct avatar *a)
{
    struct avatar_scratch *s = a->scratch;
    int skip = a->config.rgb_skip;
    size_t g = a->first[BRANCH_STATIC];

    if (a->first[BRANCH_MOUTH] == g)
        return;
    surface_height(s);
    keep_rim(s);
    bend_plane(a);
    deform(a);
    grid_sample(s->resampled, s->features, s->U, 1, s->n, s->n, s->Cf, s->n2,
                false, RESAMPLE_BORDER);
    if (skip)
        grid_sample(s->sample, s->rgba, s->U, 1, s->S, s->S, 4, s->n2, false,
                    RESAMPLE_BORDER);
    decoder_inputs(a);
    struct gaussian_out out = branch_out(a, BRANCH_STATIC);
    conv_decoder_forward(&out, s->static_in, a->normal,
                         skip ? s->static_logit : NULL, &a->static_decoder);
    branch_shift(a, g, a->first[BRANCH_MOUTH]);
    for (size_t k = 0; k < s->n2; k++)
        s->p[k] = skip ? attribute_shift(s->p_raw[k], s->p_shift[k])
                       : s->p_raw[k];
    static_lift(s->mean + 3 * g, s->U, s->p, skip ? s->surface : NULL, s->cam,
                a->normal, s->n2);
}

/* Gradients of the decoder's input rows into dU, the resampled features (in
 * their own place) and dsample. */
static void inputs_backward(struct avatar *a)
{
    struct avatar_scratch *s = a->scratch;
    size_t in = static_inputs(&a->config), Cf = s->Cf;

    for (size_t k = 0; k < s->n2; k++) {
        const float *row = s->dstatic_in + k * in;

        memcpy(s->resampled + k * Cf, row, Cf * sizeof *row);
        s->dU[2 * k] += row[Cf];
        s->dU[2 * k + 1] += row[Cf + 1];
        if (!a->config.rgb_skip)
            continue;
        s->dsample[4 * k + 3] = row[Cf + 3] +
                                s->dmatte[k] * (1 - s->held[k]);
        for (int c = 0; c < 3; c++)
            s->dsample[4 * k + c] = attribute_logit_backward(
                s->dstatic_logit[3 * k + c], s->sample[4 * k + c]);
    }
}

/* Undo U = U_0 + Phi_init([F, C]); dfeatures is added to. */
static void deform_backward(struct avatar *a)
{
    struct avatar_scratch *s = a->scratch;
    size_t Cf = s->Cf;

    if (a->without & WITHOUT_DEFORM)
        return;
    plane_init_backward(s->dinit_in, s->dU, &a->init);
    for (size_t k = 0; k < s->n2; k++)
        for (size_t c = 0; c < Cf; c++)
            s->dfeatures[k * Cf + c] += s->dinit_in[k * (Cf + 1) + c];
}

void static_bake_backward(struct avatar *a)
{
    struct avatar_scratch *s = a->scratch;
    int skip = a->config.rgb_skip;
    size_t g = a->first[BRANCH_STATIC];

    if (a->first[BRANCH_MOUTH] == g)
        return;
    memset(s->dU, 0, 2 * s->n2 * sizeof *s->dU);
    memset(s->dp, 0, s->n2 * sizeof *s->dp);
    static_lift_backward(s->dU, s->dp, s->dmean + 3 * g,
                         skip ? s->surface : NULL, s->cam, a->normal, s->n2);
    for (size_t k = 0; skip && k < s->n2; k++)
        s->dp[k] = attribute_shift_backward(s->dp[k], s->p_raw[k],
                                            s->p_shift[k]);
    branch_shift_backward(a, s->dmatte, g, a->first[BRANCH_MOUTH]);
    struct gaussian_out dout = branch_dout(a, BRANCH_STATIC);
    conv_decoder_backward(s->dstatic_in, NULL,
                          skip ? s->dstatic_logit : NULL, &dout, a->normal,
                          skip ? s->static_logit : NULL, &a->static_decoder);
    inputs_backward(a);
    if (skip)
        grid_sample_backward(NULL, s->dU, s->dsample, s->rgba, s->U, 1, s->S,
                             s->S, 4, s->n2, false, RESAMPLE_BORDER);
    grid_sample_backward(s->dfeatures, s->dU, s->resampled, s->features, s->U,
                         1, s->n, s->n, s->Cf, s->n2, false, RESAMPLE_BORDER);
    deform_backward(a);
}
