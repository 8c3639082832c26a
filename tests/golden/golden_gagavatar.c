/* Case 12: GAGAvatar's whole forward pass at its full size: backbone, planes,
 * generators, picture and StyleUNet, each from what the step before made. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/net/gagavatar.h"
#include "lib/net/dino_base.h"
#include "lib/net/harmonic.h"
#include "lib/net/style_unet.h"
#include "lib/nn/rescale.h"
#include "lib/splat/reference.h"
#include "lib/splat/splat.h"
#include "tests/golden/layout.h"

/* Memory, or the end. */
static void *gagavatar_grab(size_t n, size_t size)
{
    void *p = calloc(n + 1, size);

    if (!p) {
        fprintf(stderr, "golden: out of memory\n");
        exit(1);
    }
    return p;
}

/* cam (3,4) of the case's T, which acts on row vectors, with x to the left and
 * y up. */
static void camera_of(float cam[12], const struct golden *g, const char *name)
{
    float *T = golden_f32(g, name, NULL);

    for (int r = 0; r < 3; r++) {
        for (int k = 0; k < 3; k++)
            cam[4 * r + k] = (r < 2 ? -1 : 1) * T[4 * k + r];
        cam[4 * r + 3] = (r < 2 ? -1 : 1) * T[4 * r + 3];
    }
    free(T);
}

/* The camera as the public code hands it to its rasteriser. */
static void compare_camera(struct golden *g, const float cam[12])
{
    const double K[16] = {12, 0, 0, 0, 0, 12, 0, 0,
                          0, 0, 100 / 99.99, -1 / 99.99, 0, 0, 1, 0};
    float view[16], full[16];

    for (int i = 0; i < 4; i++)
        for (int k = 0; k < 4; k++)
            view[4 * k + i] = i < 3 ? cam[4 * i + k] : k == 3;
    for (int i = 0; i < 16; i++) {
        double sum = 0;

        for (int k = 0; k < 4; k++)
            sum += (double)view[i - i % 4 + k] * K[4 * (i % 4) + k];
        full[i] = (float)sum;
    }
    golden_compare(g, "camera.viewmatrix", view, 16);
    golden_compare(g, "camera.projmatrix", full, 16);
}

/* The backbone's parts: its picture, tokens, features. */
static void compare_backbone(struct golden *g, const struct gagavatar *a,
                             const float *rgb)
{
    const struct avatar_config *c = &a->config;
    const struct dino_base *d = backbone_dino(&a->backbone);
    const size_t E = c->backbone.embed, n2 = c->plane * c->plane;
    const size_t side = c->backbone.image;
    const size_t patches = d->vit.tokens - 1;
    struct nn_plan plan;
    struct rescale larger;
    char name[64];

    nn_plan_init(&plan, (struct nn_options){NN_INFER, NN_F32});
    rescale_plan(&larger, &plan, RESCALE_BILINEAR, 1, c->size, c->size, side,
                 side, 3);
    float *f = gagavatar_grab(side * side * 3, sizeof *f);
    if (!nn_plan_finish(&plan, &plan.err)) {
        rescale_forward(f, rgb, &larger);
        layout_compare(g, "f_image", f, 1, side * side, 3, false);
    }
    nn_plan_release(&plan);
    free(f);
    for (size_t k = 0; k < DINO_LEVELS; k++) {
        snprintf(name, sizeof name, "vit.layer%zu.norm_patch",
                 c->backbone.depth - DINO_LEVELS + k);
        golden_compare(g, name, dinov2_tokens(&d->vit, k) + E, patches * E);
    }
    layout_compare(g, "feature", a->features, 1, n2, c->feature, false);
    golden_compare(g, "global", a->token, E);
}

/* Attributes of the Gaussians `first` on under a generator's name. */
static void compare_generator(struct golden *g, const struct gagavatar *a,
                              const char *who, size_t first, size_t n,
                              const float *position)
{
    const size_t C = a->config.channels;
    const struct {
        const char *name;
        const float *x;
        size_t width;
    } part[] = {{"colors", a->color + first * C, C},
                {"opacities", a->opacity + first, 1},
                {"scales", a->scale + 3 * first, 3},
                {"rotations", a->quat + 4 * first, 4},
                {"positions", position, 1},
                {"xyz", a->mean + 3 * first, 3}};
    char name[64];

    for (size_t i = 0; i < sizeof part / sizeof *part; i++) {
        snprintf(name, sizeof name, "%s.%s.err", who, part[i].name);
        if (!golden_has(g, name))
            continue;
        name[strlen(name) - 4] = 0;
        golden_compare(g, name, part[i].x, n * part[i].width);
    }
}

static void compare_bake(struct golden *g, const struct gagavatar *a)
{
    const size_t n2 = a->config.plane * a->config.plane, V = a->V;
    float code[HARMONIC_OUT];

    harmonic_forward(code, a->axis, 1);
    golden_compare(g, "plane_points", a->points, 3 * n2);
    golden_compare(g, "plane_dirs", a->axis, 3);
    golden_compare(g, "dir_encoding", code, HARMONIC_OUT);
    compare_generator(g, a, "g", 0, V, NULL);
    compare_generator(g, a, "l0", V, n2, a->position[0]);
    compare_generator(g, a, "l1", V + n2, n2, a->position[1]);
    compare_generator(g, a, "gs", 0, a->set.n, NULL);
}

/* Centres, shapes and depths on the screen, all Gaussians. */
static void compare_projection(struct golden *g, const struct gagavatar *a,
                               const struct splat_camera *cam)
{
    const size_t N = a->set.n;
    struct reference r;
    struct reference_point p;
    struct error err = {0};
    const int size = (int)a->config.size;

    if (reference_init(&r, &a->set, cam, size, size, a->set.channels,
                       SPLAT_DGR, 0, &err)) {
        golden_fail(g, &err);
        return;
    }
    float *xy = gagavatar_grab(2 * N, sizeof *xy),
          *conic = gagavatar_grab(3 * N, sizeof *conic);
    float *z = gagavatar_grab(N, sizeof *z);
    for (size_t i = 0; i < N; i++) {
        reference_project(&p, &r, i);
        xy[2 * i] = (float)(p.x - 0.5);     /* their centres are integers */
        xy[2 * i + 1] = (float)(p.y - 0.5);
        for (int k = 0; k < 3; k++)
            conic[3 * i + k] = (float)p.conic[k];
        z[i] = (float)p.z;
    }
    golden_compare(g, "dgr.means2d_all", xy, 2 * N);
    golden_compare(g, "dgr.conic_all", conic, 3 * N);
    golden_compare(g, "dgr.depth_all", z, N);
    free(xy);
    free(conic);
    free(z);
    reference_release(&r);
}

/* Means of square blocks of planes x (C,side,side). */
static void compare_blocks(struct golden *g, const char *name, const float *x,
                           size_t C, size_t side, size_t block)
{
    const size_t small = side / block;
    float *mean = gagavatar_grab(C * small * small, sizeof *mean);

    for (size_t i = 0; i < C * small * small; i++) {
        const float *at = x + (i / (small * small)) * side * side +
                          i / small % small * block * side +
                          i % small * block;
        double sum = 0;

        for (size_t k = 0; k < block * block; k++)
            sum += at[k / block * side + k % block];
        mean[i] = (float)(sum / (double)(block * block));
    }
    golden_compare(g, name, mean, C * small * small);
    free(mean);
}

/* Also where the order of ties may have flipped: relative L2 over all stored
 * values, by the file's third figure of err_all. */
static void compare_flips(struct golden *g, const char *name, const float *x)
{
    char key[80];
    size_t n;
    double dd = 0, tt = 0;

    snprintf(key, sizeof key, "%s.sample", name);
    double *want = golden_f64(g, key, &n);
    snprintf(key, sizeof key, "%s.stride", name);
    double *at = golden_f64(g, key, NULL);
    snprintf(key, sizeof key, "%s.err_all", name);
    double *all = golden_f64(g, key, NULL);

    for (size_t k = 0; k < n; k++) {
        const double d = x[(size_t)at[0] + k * (size_t)at[1]] - want[k];

        dd += d * d;
        tt += want[k] * want[k];
    }
    snprintf(key, sizeof key, "%s (all pixels, L2)", name);
    golden_check(g, key, sqrt(dd), sqrt(dd / tt), all[2] * sqrt(tt));
    free(want);
    free(at);
    free(all);
}

/* feat (S,S,C) drawn by the public rasteriser's rules. */
static bool gagavatar_draw(float *feat, struct golden *g,
                           const struct gagavatar *a,
                           const struct splat_camera *cam)
{
    const size_t S = a->config.size, P = S * S, C = a->config.channels;
    struct splat_options opt = splat_defaults((int)S, (int)S, (int)C);
    struct splat r = {0};
    struct error err = {0};
    float *T = gagavatar_grab(P, sizeof *T);
    double *flag = golden_f64(g, "render.ambiguous", NULL);
    uint8_t *skip = gagavatar_grab(P, 1);

    opt.rules = SPLAT_DGR;
    opt.exp_degree = 5;
    opt.fixed16 = false;
    bool drawn = !splat_init(&r, &opt, &err) &&
                 !splat_load(&r, &a->set, &err) &&
                 !splat_draw(&r,
                             &(struct splat_pictures){.image = feat, .alpha = T},
                             cam, NULL, NULL, &err);
    if (!drawn)
        golden_fail(g, &err);
    for (size_t i = 0; i < P; i++) {
        T[i] = 1 - T[i];
        skip[i] = flag[i] != 0;
    }
    if (drawn) {
        float *planes = layout_planes(feat, 1, P, C);

        golden_compare_masked(g, "render", planes, C * P, skip, P);
        golden_compare_masked(g, "render.T", T, P, skip, P);
        compare_flips(g, "render", planes);
        compare_flips(g, "render.T", T);
        compare_blocks(g, "render_mean8", planes, C, S, 8);
        free(planes);
    }
    splat_release(&r);
    free(T);
    free(flag);
    free(skip);
    return drawn;
}

/* The picture, from the features as drawn. */
static void gagavatar_refine(struct golden *g, const struct golden_weights *w,
                             const struct avatar_config *c, const float *feat)
{
    const size_t P = c->size * c->size;
    struct style_unet s;
    struct params ps;
    struct error err = {0};

    params_init(&ps);
    if (style_unet_init(&s, &ps, avatar_config_refiner(c), c->channels,
                        c->size, c->size, c->refiner.multiplier, &err) ||
        params_allocate(&ps, &err)) {
        golden_fail(g, &err);
        return;
    }
    golden_weights_fill(&ps, w, g, "");
    if (style_unet_plan(&s, 1, (struct nn_options){NN_INFER, NN_FAST}, &err)) {
        golden_fail(g, &err);
    } else {
        float *rgb = gagavatar_grab(3 * P, sizeof *rgb);

        style_unet_forward(rgb, feat, &s);
        golden_compare(g, "style_code", tape_map(NULL, &s.tape, s.code),
                       tape_channels(&s.tape, s.code));
        layout_compare(g, "logits",
                       tape_map(NULL, &s.tape, s.level[s.levels - 1].rgb), 1, P,
                       3, false);
        layout_compare(g, "refined", rgb, 1, P, 3, false);
        float *planes = layout_planes(rgb, 1, P, 3);
        compare_blocks(g, "refined_mean4", planes, 3, c->size, 4);
        free(planes);
        free(rgb);
    }
    style_unet_release(&s);
    params_release(&ps);
}

/* Source to Gaussians; the network's memory is given back before the refiner
 * takes its own. */
static bool gagavatar_test_bake(float *feat, struct golden *g,
                                const struct golden_weights *w,
                                const struct avatar_config *c)
{
    struct gagavatar a;
    struct params ps;
    struct error err = {0};
    size_t count;
    const size_t P = c->size * c->size;
    float source[12], target[12];
    float *points = golden_f32(g, "t_points", &count);
    float *planes = golden_image("input.image", g->seed, 3, c->size, c->size,
                                 false);
    float *rgb = layout_rows(planes, 1, P, 3);
    bool drawn = false;

    camera_of(source, g, "source.T");
    camera_of(target, g, "target.T");
    params_init(&ps);
    if (gagavatar_init(&a, &ps, c, count / 3, &err) ||
        params_allocate(&ps, &err)) {
        golden_fail(g, &err);
    } else {
        golden_weights_fill(&ps, w, g, "");
        /* NN_FAST is within atol; the sum of l0.colors is not */
        if (gagavatar_plan(&a, NN_F32, &err)) {
            golden_fail(g, &err);
        } else {
            const struct splat_camera cam =
                splat_camera_square(target, (int)c->size, 12);

            gagavatar_bake(&a, rgb, source, points);
            compare_camera(g, target);
            compare_backbone(g, &a, rgb);
            compare_bake(g, &a);
            compare_projection(g, &a, &cam);
            drawn = gagavatar_draw(feat, g, &a, &cam);
        }
    }
    gagavatar_release(&a);
    params_release(&ps);
    free(points);
    free(planes);
    free(rgb);
    return drawn;
}

static void run_gagavatar(struct golden *g)
{
    struct avatar_config c;
    struct golden_weights w;
    cJSON *json = golden_json(g, "config");

    avatar_config_gagavatar(&c);
    c.plane = (size_t)cJSON_GetObjectItem(json, "plane")->valuedouble;
    c.size = (size_t)cJSON_GetObjectItem(json, "render")->valuedouble;
    c.channels = (size_t)cJSON_GetObjectItem(json, "channels")->valuedouble;
    cJSON_Delete(json);
    golden_weights_open(&w, g, NULL);
    float *feat = gagavatar_grab(c.size * c.size * c.channels, sizeof *feat);
    if (gagavatar_test_bake(feat, g, &w, &c))
        gagavatar_refine(g, &w, &c, feat);
    free(feat);
    golden_weights_close(&w);
}

GOLDEN_CASE("12_gagavatar", run_gagavatar)
