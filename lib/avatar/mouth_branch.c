/* The Mouth Interior Branch: a small sheet of Gaussians behind the lips that
 * follows their centroid. */
#include <math.h>
#include <string.h>

#include "lib/avatar/branches.h"
#include "lib/geom/resample.h"

#define OUTSIDE 6.0f    /* opacity logits fall outside the mouth's ellipse */
#define OVERLAP 0.6f    /* standard deviation over the spacing */
/* The decoder can ask for no less opacity, and no less of the largest scale
 * before the shift: the sheet has no holes. */
#define SOLID 0.9f
#define WIDE 0.45f

/* What an unseen mouth starts as, sRGB. */
static const float dark[3] = {0.22f, 0.08f, 0.08f};

void mouth_sheet(float *g, float *uv, const float centre[3], float radius,
                 size_t K)
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

float mouth_cap(const struct head_mouth *m)
{
    return m->bowl + 0.5f * m->lip + AVATAR_OFFSET_EPS;
}

size_t mouth_clamp(float *q, size_t N, float cap)
{
    size_t clamped = 0;

    for (size_t k = 0; k < N; k++) {
        float z = q[3 * k + 2], in = fminf(fmaxf(z, -cap), cap);

        clamped += in != z;
        q[3 * k + 2] = in;
    }
    return clamped;
}

void mouth_clamp_backward(float *dq, const float *raw, size_t N, float cap)
{
    for (size_t k = 0; k < N; k++)
        if (!(fabsf(raw[3 * k + 2]) <= cap))
            dq[3 * k + 2] = 0;
}

void mouth_hold(float *q, size_t N, float radius, float cap)
{
    float side = 0.5f * radius, depth = 0.5f * cap;

    for (size_t k = 0; k < N; k++, q += 3) {
        q[0] = side * tanhf(q[0]);
        q[1] = side * tanhf(q[1]);
        q[2] = depth * (tanhf(q[2]) - 1);
    }
}

void mouth_hold_backward(float *dq, const float *raw, size_t N, float radius,
                         float cap)
{
    float room[3] = {0.5f * radius, 0.5f * radius, 0.5f * cap};

    for (size_t i = 0; i < 3 * N; i++) {
        float t = tanhf(raw[i]);

        dq[i] *= room[i % 3] * (1 - t * t);
    }
}

size_t mouth_inputs(const struct avatar_config *c)
{
    return c->feature + 2 + (c->rgb_skip ? AVATAR_MOUTH_EXTRA : 0);
}

static float ramp(float x, float lo, float hi)
{
    float t = fminf(fmaxf((x - lo) / (hi - lo), 0), 1);

    return t * t * (3 - 2 * t);
}

/* How much of the mouth's inside the source shows at (u, v): 1 between open
 * lips, 0 on the lips and outside. */
static float opening(const struct head_mouth *m, const float uv[2], float r)
{
    float half = 0.5f * m->gap / r;
    float shape = uv[0] * uv[0] / 0.64f;

    if (half < 0.02f || shape >= 1)
        return 0;
    float edge = half * sqrtf(1 - shape);
    return 1 - ramp(fabsf(uv[1]), 0.5f * edge, edge + 1e-6f);
}

static void starting_values(struct avatar *a, float r)
{
    struct avatar_scratch *s = a->scratch;
    size_t in = mouth_inputs(&a->config), g = a->first[BRANCH_MOUTH];
    float spacing = 2 * r / (float)s->K;
    float size_shift = attribute_logit(OVERLAP * spacing / BRANCH_SCALE_MAX);

    grid_sample(s->mouth_picture, s->rgba, s->mouth_ndc, 1, s->S, s->S, 4,
                s->M, false, RESAMPLE_BORDER);
    for (size_t k = 0; k < s->M; k++) {
        const float *uv = s->uv + 2 * k, *pixel = s->mouth_picture + 4 * k;
        float *extra = s->mouth_in + (k + 1) * in - AVATAR_MOUTH_EXTRA;
        float w = opening(&a->mouth, uv, r) * pixel[3];
        float out = uv[0] * uv[0] / 0.42f + uv[1] * uv[1] / 0.35f - 1;

        extra[0] = w;
        extra[1] = a->mouth.gap / r;
        for (int c = 0; c < 3; c++)
            s->mouth_logit[3 * k + c] = attribute_logit(w * pixel[c] +
                                                        (1 - w) * dark[c]);
        s->matte[g + k] = 1;
        s->opacity_shift[g + k] = -OUTSIDE * fminf(fmaxf(2 * out, 0), 1);
        s->scale_shift[g + k] = size_shift;
    }
}

/* Lips pressed to a point still get a sheet of finite size. */
static float sheet_radius(const struct avatar *a)
{
    return fmaxf(a->mouth.radius, 1e-3f);
}

/* Most frames show closed lips and a shadow of the sheet through them:
 * training would make it fade or shrink below what is drawn, and the back of
 * the head, seen through open lips, would be painted as their inside. */
static void stay_solid(struct gaussian_out *g, size_t M)
{
    for (size_t i = 0; i < M; i++)
        g->opacity[i] = SOLID + (1 - SOLID) * g->opacity[i];
    for (size_t i = 0; i < 3 * M; i++)
        g->scale[i] = WIDE * BRANCH_SCALE_MAX + (1 - WIDE) * g->scale[i];
}

static void stay_solid_backward(struct gaussian_out *dg, size_t M)
{
    for (size_t i = 0; i < M; i++)
        dg->opacity[i] *= 1 - SOLID;
    for (size_t i = 0; i < 3 * M; i++)
        dg->scale[i] *= 1 - WIDE;
}

void mouth_bake(struct avatar *a, const float *verts)
{
    struct avatar_scratch *s = a->scratch;
    size_t g = a->first[BRANCH_MOUTH], in = mouth_inputs(&a->config);
    int skip = a->config.rgb_skip;

    head_mouth(&a->mouth, a->head, verts);
    a->cap = mouth_cap(&a->mouth);
    a->clamped = 0;
    if (a->first[BRANCH_COUNT] == g)
        return;
    float r = sheet_radius(a);
    mouth_sheet(s->sheet, s->uv, a->mouth.centre, r, s->K);
    dynamic_project(s->mouth_ndc, s->sheet, s->M, s->cam);
    grid_sample(s->mouth_sample, s->features, s->mouth_ndc, 1, s->n, s->n,
                s->Cf, s->M, false, RESAMPLE_BORDER);
    for (size_t k = 0; k < s->M; k++) {
        float *row = s->mouth_in + k * in;

        memcpy(row, s->mouth_sample + k * s->Cf, s->Cf * sizeof *row);
        memcpy(row + s->Cf, s->uv + 2 * k, 2 * sizeof *row);
    }
    if (skip)
        starting_values(a, r);
    struct gaussian_out out = branch_out(a, BRANCH_MOUTH);
    conv_decoder_forward(&out, s->mouth_in, a->normal,
                         skip ? s->mouth_logit : NULL, &a->mouth_decoder);
    if (skip)
        stay_solid(&out, s->M);
    branch_shift(a, g, a->first[BRANCH_COUNT]);
    float *mean = s->mean + 3 * g;
    memcpy(mean, s->q, 3 * s->M * sizeof *mean);
    if (skip)
        mouth_hold(mean, s->M, r, a->cap);
    a->clamped = mouth_clamp(mean, s->M, a->cap);
    for (size_t i = 0; i < 3 * s->M; i++)   /* g + q; l_d - l_s comes later */
        mean[i] += s->sheet[i];
}

void mouth_bake_backward(struct avatar *a)
{
    struct avatar_scratch *s = a->scratch;
    size_t g = a->first[BRANCH_MOUTH], in = mouth_inputs(&a->config);
    int skip = a->config.rgb_skip;

    if (a->first[BRANCH_COUNT] == g)
        return;
    memcpy(s->dq, s->dmean + 3 * g, 3 * s->M * sizeof *s->dq);
    if (skip)       /* what is held is never clamped */
        mouth_hold_backward(s->dq, s->q, s->M, sheet_radius(a), a->cap);
    else
        mouth_clamp_backward(s->dq, s->q, s->M, a->cap);
    branch_shift_backward(a, NULL, g, a->first[BRANCH_COUNT]);
    struct gaussian_out dout = branch_dout(a, BRANCH_MOUTH);
    if (skip)
        stay_solid_backward(&dout, s->M);
    conv_decoder_backward(s->dmouth_in, NULL, NULL, &dout, a->normal,
                          skip ? s->mouth_logit : NULL, &a->mouth_decoder);
    for (size_t k = 0; k < s->M; k++)
        memcpy(s->mouth_sample + k * s->Cf, s->dmouth_in + k * in,
               s->Cf * sizeof *s->mouth_sample);
    grid_sample_backward(s->dfeatures, NULL, s->mouth_sample, s->features,
                         s->mouth_ndc, 1, s->n, s->n, s->Cf, s->M, false,
                         RESAMPLE_BORDER);
}
