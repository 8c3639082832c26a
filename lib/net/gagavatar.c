/* GAGAvatar's forward pass up to the renderer (its Section 3; the order of
 * the steps and what they slip on are the public code's). */
#include "lib/net/gagavatar.h"

#include <math.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/camera.h"

/* ---- making ------------------------------------------------------------- */

int gagavatar_init(struct gagavatar *g, struct params *ps,
                   const struct avatar_config *c, size_t V,
                   struct error *err)
{
    const struct gaussian_head on_vertex = {
        .colors = c->channels, .position = GAUSSIAN_POSITION_NONE,
        .quirk_rotation = c->public_quirks};
    const struct gaussian_head on_plane = {
        .colors = c->channels, .position = GAUSSIAN_POSITION_DEPTH,
        .quirk_columns = c->public_quirks};
    const size_t base[2] = {V, c->vertex_width};
    const size_t in = c->vertex_width + c->backbone.embed;

    memset(g, 0, sizeof *g);
    g->config = *c;
    g->ps = ps;
    g->V = V;
    if (c->backbone.type != BACKBONE_DINOV2)
        return error_set(err, EX_CONFIG, "gagavatar with a small backbone "
                         "(expected \"dinov2\", whose first token it takes)");
    g->base = params_add(ps, "head_base", 2, base, PARAM_NORMAL, 1);
    mlp_decoder_init(&g->vertex, ps, "gs_generator_g.", in, c->dynamic_width,
                     c->dynamic_hidden, on_vertex);
    conv_decoder_init(&g->plane[0], ps, "gs_generator_l0.", c->feature,
                      c->static_width, on_plane);
    conv_decoder_init(&g->plane[1], ps, "gs_generator_l1.", c->feature,
                      c->static_width, on_plane);
    if (backbone_init(&g->backbone, ps, "base_model.", &c->backbone, err)) {
        gagavatar_release(g);
        return -1;
    }
    return 0;
}

int gagavatar_init_refiner(struct refiner *r, struct params *ps,
                           const struct avatar_config *c, struct error *err)
{
    return refiner_init(r, ps, avatar_config_refiner(c), &c->refiner, err);
}

/* The arrays of the set and what they are made from. */
static int gagavatar_allocate(struct gagavatar *g, struct error *err)
{
    const struct avatar_config *c = &g->config;
    const size_t n2 = c->plane * c->plane, N = g->V + 2 * n2;
    struct nn_plan *p = &g->plan;

    g->features = nn_plan_floats(p, n2 * c->feature);
    g->token = nn_plan_floats(p, c->backbone.embed);
    g->rows = nn_plan_floats(p, g->V * g->vertex.tape.picture.channels);
    g->points = nn_plan_floats(p, 3 * n2);
    g->position[0] = nn_plan_floats(p, n2);
    g->position[1] = nn_plan_floats(p, n2);
    g->mean = nn_plan_floats(p, 3 * N);
    g->scale = nn_plan_floats(p, 3 * N);
    g->quat = nn_plan_floats(p, 4 * N);
    g->opacity = nn_plan_floats(p, N);
    g->color = nn_plan_floats(p, N * c->channels);
    g->branch = nn_plan_bytes(p, N);
    if (nn_plan_finish(p, err))
        return -1;
    memset(g->branch + g->V, 1, 2 * n2);
    g->set = (struct gaussians){
        .n = N, .channels = (int)c->channels, .mean = g->mean,
        .scale = g->scale, .quat = g->quat, .opacity = g->opacity,
        .color = g->color, .branch = g->branch};
    return 0;
}

int gagavatar_plan(struct gagavatar *g, enum nn_type type, struct error *err)
{
    const struct nn_options opt = {NN_INFER, type};
    const size_t n = g->config.plane;

    nn_plan_release(&g->plan);
    nn_plan_init(&g->plan, opt);
    return gagavatar_allocate(g, err) ||
                   backbone_plan(&g->backbone, 1, g->config.size, opt, err) ||
                   mlp_decoder_plan(&g->vertex, 1, g->V, opt, err) ||
                   conv_decoder_plan(&g->plane[0], 1, n, n, opt, err) ||
                   conv_decoder_plan(&g->plane[1], 1, n, n, opt, err)
               ? -1
               : 0;
}

void gagavatar_release(struct gagavatar *g)
{
    backbone_release(&g->backbone);
    mlp_decoder_release(&g->vertex);
    conv_decoder_release(&g->plane[0]);
    conv_decoder_release(&g->plane[1]);
    nn_plan_release(&g->plan);
    memset(g, 0, sizeof *g);
}

/* ---- the planes --------------------------------------------------------- */

void gagavatar_plane(float *points, float d[3], const float cam[12], size_t n)
{
    float o[3], distance = 0;

    camera_origin(o, cam);
    for (int i = 0; i < 3; i++) {
        d[i] = cam[8 + i];                  /* R^T (0,0,1) */
        distance += o[i] * d[i];
    }
    distance = fabsf(distance);
    for (size_t k = 0; k < n * n; k++) {
        const float span = n > 1 ? 2 / (float)(n - 1) : 0;
        const float x = ((float)(k % n) * span - 1) / CAMERA_FOCAL;
        const float y = ((float)(k / n) * span - 1) / CAMERA_FOCAL;

        for (int i = 0; i < 3; i++)
            points[3 * k + i] = o[i] + distance * (cam[i] * x +
                                                   cam[4 + i] * y + d[i]);
    }
}

void gagavatar_lift(float *xyz, const float *points, const float *position,
                    const float d[3], float sign, size_t N)
{
    for (size_t k = 0; k < N; k++)
        for (int i = 0; i < 3; i++)
            xyz[3 * k + i] = points[3 * k + i] + sign * position[k] * d[i];
}

/* ---- one source --------------------------------------------------------- */

/* Gaussians from `first` on, as a decoder writes them. */
static struct gaussian_out gagavatar_part(struct gagavatar *g, size_t first,
                                          float *position)
{
    return (struct gaussian_out){
        .color = g->color + first * g->config.channels,
        .opacity = g->opacity + first, .scale = g->scale + 3 * first,
        .quat = g->quat + 4 * first, .position = position};
}

/* A row per vertex: its own learned numbers, then the picture's token. */
static void gagavatar_rows(struct gagavatar *g)
{
    const size_t W = g->config.vertex_width, E = g->config.backbone.embed;
    const float *base = param_w(g->ps, g->base);

    for (size_t v = 0; v < g->V; v++) {
        float *row = g->rows + v * (W + E);

        memcpy(row, base + v * W, W * sizeof *row);
        memcpy(row + W, g->token, E * sizeof *row);
    }
}

void gagavatar_bake(struct gagavatar *g, const float *rgb,
                    const float cam[12], const float *verts)
{
    const size_t n = g->config.plane, n2 = n * n;
    struct gaussian_out out;

    backbone_forward(g->features, rgb, &g->backbone);
    backbone_token(g->token, &g->backbone);
    gagavatar_plane(g->points, g->axis, cam, n);
    gagavatar_rows(g);
    out = gagavatar_part(g, 0, NULL);
    mlp_decoder_forward(&out, g->rows, g->axis, NULL, &g->vertex);
    memcpy(g->mean, verts, 3 * g->V * sizeof *verts);
    for (int k = 0; k < 2; k++) {
        const size_t first = g->V + (size_t)k * n2;

        out = gagavatar_part(g, first, g->position[k]);
        conv_decoder_forward(&out, g->features, g->axis, NULL, &g->plane[k]);
        gagavatar_lift(g->mean + 3 * first, g->points, g->position[k],
                       g->axis, k ? -1 : 1, n2);
    }
}
