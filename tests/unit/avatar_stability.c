/* Baking and driving where it is hard: source at the picture's border, a
 * profile, a closed mouth, huge expressions, an empty matte, a camera inside
 * the head.  Everything stays finite and within its range. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/avatar/branch.h"
#include "lib/avatar/baked.h"
#include "lib/base/camera.h"
#include "lib/base/rotation.h"
#include "lib/head/lbs.h"
#include "lib/lab/head/avatar_make.h"
#include "tests/check.h"
#include "tests/unit/shipped_mouth.h"
#include "tests/unit/sphere_head.h"

#define S 64

static int all_finite(const float *x, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (!isfinite(x[i]))
            return 0;
    return 1;
}

static int stability_within(const float *x, size_t n, float lo, float hi)
{
    for (size_t i = 0; i < n; i++)
        if (!(x[i] >= lo && x[i] <= hi))
            return 0;
    return 1;
}

static int stability_sound(const struct gaussians *g, const float *means)
{
    size_t n = g->n, C = (size_t)g->channels;

    return all_finite(means, 3 * n) && all_finite(g->mean, 3 * n)
           && all_finite(g->quat, 4 * n) && all_finite(g->color, C * n)
           && stability_within(g->opacity, n, 0, 1)
           && stability_within(g->scale, 3 * n, 0, 0.05001f);
}

struct world {
    struct head head;
    struct params ps;
    struct avatar a;
    struct identity id;
    float *verts, *means;
    uint8_t rgb[3 * S * S], matte[S * S];
};

/* Bake at a pose and camera, drive to another; all numbers sound? */
static int stability_try(struct world *w, const struct head_motion *at,
                         const float turn[3], const float t[3],
                         const struct head_motion *to)
{
    const float F[9] = {1, 0, 0, 0, -1, 0, 0, 0, -1};
    float R[9], Q[9], cam[12];

    rotation_exp(R, turn);
    mat3_mul(Q, F, R);
    camera_make(cam, Q, t);
    head_pose(w->verts, &w->id, at);
    avatar_bake(&w->a, &(struct avatar_source){.rgb = w->rgb,
                                               .matte = w->matte,
                                               .verts = w->verts, .cam = cam});
    head_pose(w->verts, &w->id, to);
    avatar_drive(w->means, &w->a, w->verts, cam);
    return stability_sound(&w->a.set, w->means);
}

static void stability_make(struct world *w)
{
    struct avatar_config c;
    struct error err = {0};

    memset(w, 0, sizeof *w);
    sphere_head(&w->head, 9, 14);
    avatar_config_shipped(&c);
    c.size = S;
    c.plane = c.backbone.size = 24;
    c.mouth = 6;
    c.channels = 5;
    c.feature = c.backbone.features = 8;
    c.backbone.width = 4;
    params_init(&w->ps);
    if (avatar_make(&w->head, shipped_mouth(), &err) ||
        avatar_init(&w->a, &w->ps, &c, &w->head, &err) ||
        params_allocate(&w->ps, &err)) {
        printf("%s\n", err.text);
        exit(1);
    }
    params_randomise(&w->ps, 7);
    avatar_init_weights(&w->a);
    if (avatar_plan(&w->a, (struct nn_options){NN_INFER, NN_F32}, &err)) {
        printf("%s\n", err.text);
        exit(1);
    }
    head_fold(&w->id, &w->head, NULL, 0, &err);
    w->verts = calloc(3 * w->head.V, sizeof(float));
    w->means = calloc(3 * 4096, sizeof(float));
    for (size_t i = 0; i < sizeof w->rgb; i++)
        w->rgb[i] = (uint8_t)(i * 7);
    memset(w->matte, 255, sizeof w->matte);
}

/* Vertices alone, after a full bake of the same source: whether the reach of
 * the midpoints stays out of the plane's rows, which follow the vertices'. */
static bool stability_reach_fits(struct world *w, const float t[3])
{
    const float none[3] = {0};
    const struct head_motion rest = {0};
    const size_t V = w->head.V;
    float *full = calloc(w->a.dynamic.count, sizeof *full);
    size_t midpoints = 0, moved = 0, spilt = 0;

    stability_try(w, &rest, none, t, &rest);
    memcpy(full, w->a.set.reach, w->a.dynamic.count * sizeof *full);
    w->a.without = WITHOUT_INTERP;
    stability_try(w, &rest, none, t, &rest);
    for (size_t k = V; k < w->a.dynamic.count; k++)
        midpoints += full[k] != 0;
    for (size_t k = 0; k < V; k++)
        moved += w->a.set.reach[k] != full[k];
    for (size_t k = V; k < w->a.first[BRANCH_MOUTH]; k++)
        spilt += w->a.set.reach[k] != 0;
    w->a.without = 0;
    free(full);
    return w->a.first[BRANCH_STATIC] == V && midpoints > 0 && moved == 0 &&
           spilt == 0;
}

int main(void)
{
    static struct world w;
    const float none[3] = {0}, front[3] = {0, 0, 12};
    const float profile[3] = {0, 1.5708f, 0}, border[3] = {1, 0.8f, 12};
    const float outside[3] = {5, 5, 12}, inside[3] = {0, 0, 0.1f};
    const float far[3] = {0, 0, 1e4f};
    float huge_exp[SPHERE_EXP] = {500, -500, 500, 500};
    struct head_motion rest = {0}, wide = {.exp = huge_exp, .jaw = {3.1f}};
    struct head_motion open = {.jaw = {0.5f}};

    stability_make(&w);
    check_that("frontal source", stability_try(&w, &rest, none, front, &open));
    check_that("profile source, half the vertices hidden",
               stability_try(&w, &rest, profile, front, &open));
    size_t hidden = 0;
    for (size_t k = 0; k < w.a.dynamic.count; k++)
        hidden += w.a.dynamic.trust[k] < 0.5f;
    check_that("  and the hidden ones are known",
               hidden > w.a.dynamic.count / 3 && hidden < w.a.dynamic.count);
    check_that("source at the picture's border",
               stability_try(&w, &rest, none, border, &open));
    check_that("source outside the picture",
               stability_try(&w, &rest, none, outside, &rest));
    check_that("camera inside the head",
               stability_try(&w, &rest, none, inside, &rest));
    check_that("camera far away", stability_try(&w, &rest, none, far, &rest));
    check_that("vertices alone: the midpoints' reach is nobody's",
               stability_reach_fits(&w, front));
    check_that("huge expressions, jaw near pi",
               stability_try(&w, &open, none, front, &wide));
    check_that("source with huge expressions",
               stability_try(&w, &wide, none, front, &rest));
    memset(w.matte, 0, sizeof w.matte);
    check_that("empty matte", stability_try(&w, &rest, none, front, &open));
    check_that("  and the plane is clear",
               stability_within(w.a.set.opacity + w.a.first[1],
                                w.a.first[2] - w.a.first[1], 0, 0));
    memset(w.matte, 255, sizeof w.matte);
    /* all lip vertices on one point: r_lip = 0 */
    for (size_t i = 0; i < w.head.nlip_inner; i++)
        w.head.lip_inner[i] = w.head.lip_inner[0];
    check_that("lips pressed to a point",
               stability_try(&w, &rest, none, front, &open));
    check_that("  and the grid keeps a finite size",
               w.a.mouth.lips.radius == 0 &&
               w.a.set.scale[3 * w.a.first[2]] > 0);
    avatar_release(&w.a);
    params_release(&w.ps);
    identity_release(&w.id);
    head_release(&w.head);
    free(w.verts);
    free(w.means);
    return check_status();
}
