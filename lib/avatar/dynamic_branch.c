/* The Dynamic Branch: Gaussians on the vertices and edge midpoints of the
 * head mesh, which the driven mesh carries along. */
#include <math.h>
#include <string.h>

#include "lib/avatar/branches.h"
#include "lib/avatar/coverage.h"
#include "lib/geom/camera.h"
#include "lib/geom/resample.h"

#define OUTSIDE 6.0f    /* opacity logits fall where the matte is empty */
#define OVERLAP 0.6f    /* standard deviation over the spacing */
#define SLACK 0.03f     /* a vertex this far behind the surface is seen */

void dynamic_project(float *ndc, const float *x, size_t N,
                     const float cam[12])
{
    camera_project(ndc, NULL, cam, 2, x, N);
    for (size_t i = 0; i < 2 * N; i++)
        ndc[i] -= 1;
}

size_t dynamic_inputs(const struct avatar_config *c)
{
    return c->vertex_width + c->feature +
           (c->rgb_skip ? AVATAR_DYNAMIC_EXTRA : 0);
}

/* Ring by ring from the shown vertices: a vertex of the next ring takes the
 * mean of its coloured neighbours.  Returns nothing; vertices no edge leads
 * to keep the mean of all shown ones. */
static void spread_rings(float *rgb, const struct densify *d, int *level,
                         float *sum)
{
    int more = 1;

    for (int ring = 1; more; ring++) {
        more = 0;
        memset(sum, 0, 4 * d->V * sizeof *sum);
        for (size_t e = 0; e < 2 * d->E; e++) {
            size_t i = (size_t)d->edge[e], j = (size_t)d->edge[e ^ 1];

            if (level[i] >= 0 || level[j] < 0 || level[j] >= ring)
                continue;
            for (int c = 0; c < 3; c++)
                sum[4 * i + c] += rgb[3 * j + c];
            sum[4 * i + 3]++;
        }
        for (size_t i = 0; i < d->V; i++) {
            if (level[i] >= 0 || sum[4 * i + 3] == 0)
                continue;
            for (int c = 0; c < 3; c++)
                rgb[3 * i + c] = sum[4 * i + c] / sum[4 * i + 3];
            level[i] = ring;
            more = 1;
        }
    }
}

/* A sweep of averaging: what weight does not hold moves to the neighbours'
 * mean. */
static void smooth(float *rgb, const float *own, const float *weight,
                   const struct densify *d, float *sum)
{
    memset(sum, 0, 4 * d->V * sizeof *sum);
    for (size_t e = 0; e < 2 * d->E; e++) {
        size_t i = (size_t)d->edge[e], j = (size_t)d->edge[e ^ 1];

        for (int c = 0; c < 3; c++)
            sum[4 * i + c] += rgb[3 * j + c];
        sum[4 * i + 3]++;
    }
    for (size_t i = 0; i < d->V; i++)
        for (int c = 0; c < 3 && sum[4 * i + 3] > 0; c++)
            rgb[3 * i + c] = weight[i] * own[3 * i + c] +
                             (1 - weight[i]) * sum[4 * i + c] /
                             sum[4 * i + 3];
}

void dynamic_spread(float *rgb, const float *weight, const struct densify *d,
                    int *level, float *tmp)
{
    float *own = tmp, *sum = tmp + 3 * d->V, mean[3] = {0}, total = 1e-6f;

    memcpy(own, rgb, 3 * d->V * sizeof *own);
    for (size_t i = 0; i < d->V; i++) {
        level[i] = weight[i] > 0.5f ? 0 : -1;
        for (int c = 0; c < 3; c++)
            mean[c] += weight[i] * rgb[3 * i + c];
        total += weight[i];
    }
    spread_rings(rgb, d, level, sum);
    for (size_t i = 0; i < d->V; i++)
        for (int c = 0; c < 3 && level[i] < 0; c++)
            rgb[3 * i + c] = mean[c] / total;
    for (int sweep = 0; sweep < 12; sweep++)
        smooth(rgb, own, weight, d, sum);
    for (size_t e = 0; e < d->E; e++) {
        const float *p = rgb + 3 * (size_t)d->edge[2 * e];
        const float *q = rgb + 3 * (size_t)d->edge[2 * e + 1];
        float w = weight[d->V + e], *mid = rgb + 3 * (d->V + e);

        for (int c = 0; c < 3; c++)
            mid[c] = w * mid[c] + (1 - w) * 0.5f * (p[c] + q[c]);
    }
}

/* n.v of the densified vertices: cosine between normal and the way to the
 * camera. */
static float facing(const struct avatar_scratch *s, size_t k,
                    const float eye[3])
{
    const float *x = s->dense + 3 * k, *n = s->dense_normals + 3 * k;
    float v[3], dot = 0, len = 1e-12f;

    for (int c = 0; c < 3; c++) {
        v[c] = eye[c] - x[c];
        dot += v[c] * n[c];
        len += v[c] * v[c];
    }
    return dot / sqrtf(len);
}

static float ramp(float x, float lo, float hi)
{
    float t = fminf(fmaxf((x - lo) / (hi - lo), 0), 1);

    return t * t * (3 - 2 * t);
}

/* Visibility, coverage and matte of every densified vertex, into the extra
 * columns of the decoder's input; colours and starting values. */
static void starting_values(struct avatar *a)
{
    struct avatar_scratch *s = a->scratch;
    size_t in = dynamic_inputs(&a->config);
    float eye[3], *rgb = s->dynamic_logit;

    camera_origin(eye, s->cam);
    coverage_seen(s->seen, s->dense, s->D, s->zbuffer, s->n, s->cam, SLACK);
    grid_sample(s->dpicture, s->rgba, s->ndc, 1, s->S, s->S, 4, s->D, false,
                RESAMPLE_BORDER);
    for (size_t k = 0; k < s->D; k++) {
        const float *pixel = s->dpicture + 4 * k;
        float *extra = s->dynamic_in + (k + 1) * in - AVATAR_DYNAMIC_EXTRA;
        float nv = facing(s, k, eye), matte = pixel[3];

        extra[0] = nv;
        extra[1] = s->seen[k];
        extra[2] = s->seen[k] * ramp(nv, 0.05f, 0.4f);
        extra[3] = matte;
        s->weight[k] = extra[2] * ramp(matte, 0.5f, 0.9f);
        memcpy(rgb + 3 * k, pixel, 3 * sizeof *rgb);
        s->matte[k] = 1 - a->lining[k];
        s->opacity_shift[k] = -OUTSIDE * s->seen[k] * (1 - matte);
        s->scale_shift[k] = attribute_logit(OVERLAP * s->spacing[k] /
                                            BRANCH_SCALE_MAX);
    }
    dynamic_spread(rgb, s->weight, &a->dense, s->level, s->tmp);
    for (size_t i = 0; i < 3 * s->D; i++)
        rgb[i] = attribute_logit(rgb[i]);
}

void dynamic_bake(struct avatar *a, const float *verts)
{
    struct avatar_scratch *s = a->scratch;
    size_t in = dynamic_inputs(&a->config), hw = a->config.vertex_width;
    int skip = a->config.rgb_skip;
    float body[12];

    if (a->first[BRANCH_STATIC] == 0)
        return;
    densify_forward(s->dense, verts, &a->dense, 3);
    bend_body(body, a->bend.pivot, avatar_upright, s->cam);
    bend_points(s->dense, s->dense, s->bend, a->first[BRANCH_STATIC], body);
    head_normals(s->normals, a->head, s->bent);
    densify_forward(s->dense_normals, s->normals, &a->dense, 3);
    densify_spacing(s->spacing, s->bent, &a->dense);
    dynamic_project(s->ndc, s->dense, s->D, s->cam);
    /* d_k = GridSample(F, p_k); h_k of a midpoint is the mean of its ends */
    grid_sample(s->dsampled, s->features, s->ndc, 1, s->n, s->n, s->Cf, s->D,
                false, RESAMPLE_BORDER);
    densify_forward(s->h, param_w(a->ps, a->head_base), &a->dense, hw);
    for (size_t k = 0; k < s->D; k++) {
        float *row = s->dynamic_in + k * in;

        memcpy(row, s->h + k * hw, hw * sizeof *row);
        memcpy(row + hw, s->dsampled + k * s->Cf, s->Cf * sizeof *row);
    }
    if (skip)
        starting_values(a);
    struct gaussian_out out = branch_out(a, BRANCH_DYNAMIC);
    mlp_decoder_forward(&out, s->dynamic_in, a->normal,
                        skip ? s->dynamic_logit : NULL, &a->dynamic_decoder);
    branch_shift(a, 0, a->first[BRANCH_STATIC]);
    /* mu_k = densified vertex */
    memcpy(s->mean, s->dense, 3 * a->first[BRANCH_STATIC] * sizeof *s->mean);
}

void dynamic_bake_backward(struct avatar *a)
{
    struct avatar_scratch *s = a->scratch;
    size_t in = dynamic_inputs(&a->config), hw = a->config.vertex_width;
    int skip = a->config.rgb_skip;

    if (a->first[BRANCH_STATIC] == 0)
        return;
    branch_shift_backward(a, NULL, 0, a->first[BRANCH_STATIC]);
    struct gaussian_out dout = branch_dout(a, BRANCH_DYNAMIC);
    mlp_decoder_backward(s->ddynamic_in, NULL, NULL, &dout, a->normal,
                         skip ? s->dynamic_logit : NULL, &a->dynamic_decoder);
    memset(s->h, 0, s->D * hw * sizeof *s->h);
    memset(s->dsampled, 0, s->D * s->Cf * sizeof *s->dsampled);
    for (size_t k = 0; k < a->first[BRANCH_STATIC]; k++) {
        const float *row = s->ddynamic_in + k * in;

        memcpy(s->h + k * hw, row, hw * sizeof *row);
        memcpy(s->dsampled + k * s->Cf, row + hw, s->Cf * sizeof *row);
    }
    densify_backward(param_g(a->ps, a->head_base), s->h, &a->dense, hw);
    grid_sample_backward(s->dfeatures, NULL, s->dsampled, s->features, s->ndc,
                         1, s->n, s->n, s->Cf, s->D, false, RESAMPLE_BORDER);
}
