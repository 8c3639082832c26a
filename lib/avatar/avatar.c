/* The avatar as a whole: declares and plans its parts, runs the branches over
 * one set of Gaussians (Phase A), moves the set (Phase B), and goes back
 * through both for training. */
#include "lib/avatar/avatar.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/avatar/lip_lining.h"
#include "lib/avatar/relief.h"
#include "lib/base/relative_pose.h"
#include "lib/base/slices.h"
#include "lib/net/model.h"
#include "lib/photo/place.h"

#define GREY 0.8f       /* what is white where no face says it */

/* The head's template avatar fits the mesh's edges. */
static int avatar_check_template(const struct avatar *a, struct error *err)
{
    const size_t D = a->head->V + a->dense.E;

    if (a->head->avatar.points == D)
        return 0;
    return error_set(err, EX_CONFIG, "the head has a template avatar of %zu "
                     "points (expected %zu, as spid-head -o writes it)",
                     a->head->avatar.points, D);
}

/* The order of declaration is the order of the weights in memory, in
 * checkpoints and for Adam: it stays. */
int avatar_init(struct avatar *a, struct params *ps,
                const struct avatar_config *config, const struct head *head,
                struct error *err)
{
    memset(a, 0, sizeof *a);
    a->config = *config;
    a->head = head;
    a->ps = ps;
    a->without = avatar_config_without(config);
    if (config->system != SYSTEM_SPID)
        return error_set(err, EX_CONFIG, "the configuration is of another "
                         "system (expected \"system\": \"spid\")");
    if (model_check_head(config, head, err))
        return -1;
    if (head->nlip_inner == 0)
        return error_set(err, EX_CONFIG, "head has no inner lip ring "
                         "(expected the list lip_inner)");
    if (densify_init(&a->dense, head->f, head->F, head->V, err) ||
        avatar_check_template(a, err) ||
        backbone_init(&a->backbone, ps, "backbone.", &config->backbone, err)) {
        avatar_release(a);
        return -1;
    }
    static_branch_init(&a->plane, ps, config);
    mouth_branch_init(&a->mouth, ps, config);
    dynamic_branch_init(&a->dynamic, ps, config, head, &a->dense);
    return 0;
}

void avatar_init_weights(struct avatar *a)
{
    static_branch_init_weights(a->ps, &a->config);
    mouth_branch_init_weights(a->ps, &a->config);
    dynamic_branch_init_weights(a->ps);
}

/* The arrays of the whole set, for the most Gaussians there can be. */
static int avatar_allocate(struct avatar *a, struct error *err)
{
    const struct avatar_config *c = &a->config;
    size_t D = a->dynamic.count, n2 = a->plane.count;
    size_t C = a->colors ? a->colors : c->channels;
    size_t N = D + n2 + a->mouth.count;
    struct branch_set *s = &a->all, *d = &a->dall;
    const struct slice slices[] = {
        {&a->features, n2 * c->feature, false},
        {&a->dfeatures, n2 * c->feature, true},
        {&s->mean, 3 * N, false}, {&s->scale, 3 * N, false},
        {&s->quat, 4 * N, false}, {&s->opacity, N, false},
        {&s->color, C * N, false}, {&s->neck, N, false},
        {&s->seen, N, false}, {&a->uv, 2 * N, false}, {&a->reach, N, false},
        {&a->tilt, 2 * N, false}, {&a->normal, 3 * N, false},
        {&d->mean, 3 * N, true}, {&d->scale, 3 * N, true},
        {&d->quat, 4 * N, true}, {&d->opacity, N, true},
        {&d->color, C * N, true}, {&a->frame_dmean, 3 * N, true},
        {&a->densified, 3 * D, false}, {&a->ddensified, 3 * D, true},
        {&a->branch, N / 4 + 1, false}
    };

    s->channels = d->channels = C;
    return slices_allocate(&a->block, slices, sizeof slices / sizeof *slices,
                           a->train, err);
}

/* What learns from it would learn to leave it out: one cannot know it. */
static int avatar_plan_grain(struct avatar *a, struct nn_options opt,
                             struct error *err)
{
    const size_t N = a->dynamic.count + a->plane.count + a->mouth.count;

    return a->train || !a->config.rgb_skip
               ? 0 : grain_init(&a->grain, a->head, N, a->config.size, opt,
                               err);
}

/* Buffers and networks of every part; with WITHOUT_INTERP the dynamic
 * decoder computes vertices alone. */
int avatar_plan(struct avatar *a, struct nn_options opt, struct error *err)
{
    const struct avatar_config *c = &a->config;
    size_t points = a->without & WITHOUT_INTERP ? a->head->V : a->dynamic.count;

    a->train = opt.mode != NN_INFER;
    a->dynamic.decoder.head.kept = a->plane.decoder.head.kept =
        a->mouth.decoder.head.kept = a->colors;
    /* the networks run one after another (avatar_bake): the first plan has the
     * largest maps, and the others' are parts of its memory */
    nn_pool_use(&a->pool);
    int rc = avatar_allocate(a, err) ||
             source_picture_init(&a->picture, c->size, err) ||
             source_mesh_init(&a->source, a->head, c->plane, err) ||
             tilt_init(&a->tilted, c->plane, err) ||
             static_branch_plan(&a->plane, opt, err) ||
             backbone_plan(&a->backbone, 1, c->size, opt, err) ||
             dynamic_branch_plan(&a->dynamic, points, opt, err) ||
             mouth_branch_plan(&a->mouth, opt, err) ||
             avatar_plan_grain(a, opt, err) ? -1 : 0;
    nn_pool_use(NULL);
    return rc;
}

void avatar_release(struct avatar *a)
{
    free(a->block);
    source_picture_release(&a->picture);
    source_mesh_release(&a->source);
    tilt_release(&a->tilted);
    grain_release(&a->grain);
    dynamic_branch_release(&a->dynamic);
    static_branch_release(&a->plane);
    mouth_branch_release(&a->mouth);
    backbone_release(&a->backbone);
    densify_release(&a->dense);
    nn_pool_release(&a->pool);
    memset(a, 0, sizeof *a);
}

/* ---- Phase A ----------------------------------------------------------- */

/* Which Gaussians there are. */
static void avatar_count(struct avatar *a)
{
    unsigned w = a->without;
    size_t V = a->head->V, n[BRANCH_COUNT] = {
        w & WITHOUT_DYNAMIC ? 0 : w & WITHOUT_INTERP ? V : a->dynamic.count,
        w & WITHOUT_STATIC ? 0 : a->plane.count,
        w & WITHOUT_MOUTH ? 0 : a->mouth.count
    };

    a->first[0] = 0;
    for (int b = 0; b < BRANCH_COUNT; b++) {
        a->first[b + 1] = a->first[b] + n[b];
        memset(a->branch + a->first[b], b, n[b]);
    }
    a->all.n = a->dall.n = a->first[BRANCH_COUNT];
    a->plane.uniform = w & WITHOUT_DEFORM;
}

/* Branch b's part of all Gaussians, or of their gradients. */
static struct branch_set avatar_part(const struct avatar *a,
                                     const struct branch_set *s,
                                     enum avatar_branch b)
{
    return branch_slice(s, a->first[b], a->first[b + 1] - a->first[b]);
}

/* The views of the baked set: for the renderer, and for Phase B. */
static void avatar_views(struct avatar *a)
{
    const struct branch_set *s = &a->all;

    a->set = (struct gaussians){
        .n = s->n, .channels = (int)s->channels, .mean = s->mean,
        .scale = s->scale, .quat = s->quat, .opacity = s->opacity,
        .color = s->color, .branch = a->branch, .uv = a->uv, .seen = s->seen,
        .reach = a->reach, .tilt = a->tilt, .normal = a->normal,
        .around = a->grain.around,
        .light = {a->light[0], a->light[1], a->light[2]}
    };
    a->drive = (struct drive){
        .dynamic = a->first[BRANCH_STATIC], .mouth = a->first[BRANCH_MOUTH],
        .mouth_count = s->n - a->first[BRANCH_MOUTH], .mean = s->mean,
        .weight = s->neck,
        .jaw = a->mouth.prior && a->head->nchin && a->mouth.lips.radius > 0
             ? a->mouth.jaw : NULL
    };
    memcpy(a->drive.pivot, a->head->avatar.neck_blend, sizeof a->drive.pivot);
    for (int i = 0; i < 9; i++)     /* R_s */
        a->drive.source[i] = a->source.cam[4 * (i / 3) + i % 3];
    relative_lamp(a->lamp, a->drive.source, a->light);
}

/* The picture, unless it was the last one looked at, and the mesh on it. */
static void avatar_observe(struct avatar *a, const struct avatar_source *src)
{
    if (src->rgb != a->observed)
        source_picture_set(&a->picture, src->rgb, src->matte, src->certain,
                           a->config.rgb_skip);
    a->observed = src->rgb;
    source_mesh_set(&a->source, src->verts, src->rest, src->cam,
                    !(a->without & WITHOUT_NECK));
}

/* l (3) on a source that cam (3,4) sees, in the head's frame; from (3): in the
 * camera's, or NULL: 0. */
static void avatar_light(float l[3], const float *from, const float *cam)
{
    float lamp[LAMP_SIZE] = {0}, now[LAMP_SIZE];

    if (from)
        memcpy(lamp, from, 3 * sizeof *from);
    relative_light(now, lamp, cam);
    memcpy(l, now, 3 * sizeof *l);
}

/* What is white between the lips of the picture just looked at, in light l (3). */
static void avatar_mouth_white(float white[3], const struct avatar *a,
                               const float l[3])
{
    const bool dynamic = !(a->without & WITHOUT_DYNAMIC);

    for (int c = 0; c < 3; c++)
        white[c] = lip_lining_share(l) * (dynamic ? a->dynamic.white[c] : GREY);
}

/* What further pictures show is noted before the first one is baked; where it is
 * not known how they are lit, as the first one. */
static void avatar_observe_further(struct avatar *a,
                                   const struct avatar_source *src)
{
    a->dynamic.has_more = false;
    mouth_branch_begin(&a->mouth);
    if (!src->nmore || !a->config.rgb_skip || a->without & WITHOUT_DYNAMIC)
        return;
    avatar_observe(a, src);
    dynamic_branch_begin(&a->picture, &a->source, &a->dynamic);
    for (size_t k = 0; k < src->nmore; k++) {
        const struct avatar_source *more = src->more + k;
        float light[3], white[3];

        avatar_light(light, more->light ? more->light : src->light, more->cam);
        avatar_observe(a, more);
        dynamic_branch_add(&a->picture, &a->source, light, &a->dynamic);
        avatar_mouth_white(white, a, light);
        mouth_branch_add(&a->picture, &a->source, white, &a->mouth);
    }
}

void avatar_relief(float *offset, struct avatar *a,
                   const struct avatar_source *src)
{
    float *relief = a->densified;       /* nothing is driven yet */

    memset(offset, 0, 3 * a->head->V * sizeof *offset);
    if (!a->config.rgb_skip || a->without & WITHOUT_DYNAMIC)
        return;
    for (size_t k = 0; k <= src->nmore; k++) {
        avatar_observe(a, k ? src->more + k - 1 : src);
        dynamic_branch_relief(relief, k > 0, &a->picture, &a->source,
                              &a->dynamic);
    }
    if (src->nmore)
        avatar_observe(a, src);
    dynamic_branch_meet(relief, &a->picture, &a->source, &a->dynamic);
    relief_drape(offset, a->dynamic.tmp, relief, &a->source, &a->dense);
    const float rise = lip_lining_rise(&a->picture, &a->source);
    for (size_t v = 0; v < a->head->V; v++)
        offset[3 * v + 1] += rise * a->head->avatar.lips[v];
}

/* Of the mesh where Gaussians lie on it; elsewhere of what the source's camera
 * saw, whose depth rises by tilt; none of the shoulders. */
static void avatar_normals(struct avatar *a)
{
    const size_t D = a->first[BRANCH_STATIC];
    const float *cam = a->source.cam;

    memcpy(a->normal, a->dynamic.normals, 3 * D * sizeof *a->normal);
    for (size_t i = D; i < a->all.n; i++) {
        const float *t = a->tilt + 2 * i;
        const float by = (1 - a->all.neck[i]) /
                         sqrtf(t[0] * t[0] + t[1] * t[1] + 1);

        for (int k = 0; k < 3; k++)
            a->normal[3 * i + (size_t)k] =
                by * (t[0] * cam[k] + t[1] * cam[4 + k] - cam[8 + k]);
    }
}

/* Phase A: features once, then every branch writes its part of the set. */
void avatar_bake(struct avatar *a, const struct avatar_source *src)
{
    avatar_count(a);
    struct branch_set dynamic = avatar_part(a, &a->all, BRANCH_DYNAMIC);
    struct branch_set plane = avatar_part(a, &a->all, BRANCH_STATIC);
    struct branch_set mouth = avatar_part(a, &a->all, BRANCH_MOUTH);
    float white[3];

    avatar_light(a->light, a->config.rgb_skip ? src->light : NULL, src->cam);
    memcpy(a->dynamic.light, a->light, sizeof a->light);
    avatar_observe_further(a, src);
    avatar_observe(a, src);
    a->observed = NULL;         /* the next one's may lie where it does */
    tilt_find(&a->tilted, &a->picture, &a->source);
    backbone_forward(a->features, a->picture.rgb, &a->backbone);
    /* the dynamic branch first: its decoder may write rows beyond its own,
     * which the others then write over */
    dynamic_branch_forward(&dynamic, a->features, &a->picture, &a->source,
                           &a->dynamic);
    static_branch_forward(&plane, a->features, &a->picture, &a->source,
                          a->dynamic.colors, &a->plane);
    avatar_mouth_white(white, a, a->light);
    mouth_branch_forward(&mouth, a->features, &a->picture, &a->source, white,
                         &a->mouth);
    memset(a->reach, 0, a->all.n * sizeof *a->reach);
    if (a->config.rgb_skip && dynamic.n)
        dynamic_branch_reach(a->reach, dynamic.n, &a->source, &a->dynamic);
    if (a->config.rgb_skip)
        memcpy(a->reach + a->first[BRANCH_MOUTH], a->mouth.reach,
               mouth.n * sizeof *a->reach);
    place_of_source(a->uv, a->all.seen, a->all.mean, a->all.scale, src->cam,
                    a->all.n);
    tilt_sample(a->tilt, &a->tilted, a->uv, a->all.neck, a->all.n);
    if (a->config.rgb_skip)
        dynamic_branch_tilt(a->tilt, a->all.neck, dynamic.n, &a->source,
                            &a->dynamic);
    if (a->grain.size)
        grain_find(&a->grain, dynamic.n, a->all.n, &a->dynamic, &a->source,
                   &a->picture);
    avatar_normals(a);
    avatar_views(a);
    if (!a->train)
        return;
    branch_clear(&a->dall);
    memset(a->frame_dmean, 0, 3 * a->all.n * sizeof *a->frame_dmean);
}

/* The branches in reverse; all of them add to the gradient of the features. */
void avatar_bake_backward(struct avatar *a)
{
    struct branch_set dynamic = avatar_part(a, &a->dall, BRANCH_DYNAMIC);
    struct branch_set plane = avatar_part(a, &a->dall, BRANCH_STATIC);
    struct branch_set mouth = avatar_part(a, &a->dall, BRANCH_MOUTH);

    memset(a->dfeatures, 0,
           a->plane.count * a->config.feature * sizeof *a->dfeatures);
    mouth_branch_backward(a->dfeatures, &mouth, a->features, &a->source,
                          &a->mouth);
    static_branch_backward(a->dfeatures, &plane, a->features, &a->picture,
                           &a->source, &a->plane);
    dynamic_branch_backward(a->dfeatures, &dynamic, a->features, &a->source,
                            &a->dynamic);
    backbone_backward(a->dfeatures, &a->backbone);
}

/* ---- Phase B ----------------------------------------------------------- */

/* Phase B: mu_D, mu_S and mu_M of a frame, as lib/base/drive.h has them. */
void avatar_drive(float *means, struct avatar *a, const float *verts,
                  const float cam[12])
{
    const struct drive *d = &a->drive;
    const struct head *h = a->head;
    struct drive_frame f;

    memcpy(a->frame_cam, cam, sizeof a->frame_cam);
    drive_bodies(&f, d, cam);
    memset(f.to, 0, sizeof f.to);
    memset(f.from, 0, sizeof f.from);
    head_centroid(f.chin, h->chin, h->nchin, verts);
    for (int c = 0; c < 3; c++)
        f.chin[c] -= a->mouth.lips.chin[c];
    if (!d->jaw) {
        head_centroid(f.to, h->lip_inner, h->nlip_inner, verts);
        memcpy(f.from, a->mouth.lips.centre, sizeof f.from);
    }
    drive_dynamic(means, a->densified, d, &f, &a->dense, verts);
    drive_static(means + 3 * d->dynamic, d, &f, d->dynamic,
                 d->mouth - d->dynamic);
    drive_mouth(means + 3 * d->mouth, d, &f);
}

/* Reverse of avatar_drive; what belongs to the source waits in dall.mean. */
void avatar_drive_backward(float *dverts, float dcam[12], struct avatar *a)
{
    const struct drive *d = &a->drive;
    const struct head *h = a->head;
    size_t at = 3 * d->dynamic, mouth = 3 * d->mouth;
    float dlip[3] = {0}, dchin[3] = {0}, *dout = a->frame_dmean;

    drive_dynamic_backward(dverts, dcam, a->ddensified, dout, a->densified, d,
                           &a->dense, a->frame_cam);
    drive_static_backward(a->dall.mean + at, dcam, dout + at, d, d->dynamic,
                          d->mouth - d->dynamic, a->frame_cam);
    drive_mouth_backward(a->dall.mean + mouth, dlip, dchin, dout + mouth, d);
    if (d->jaw)
        head_centroid_backward(dverts, dchin, h->chin, h->nchin);
    else
        head_centroid_backward(dverts, dlip, h->lip_inner, h->nlip_inner);
    memset(dout, 0, 3 * a->all.n * sizeof *dout);
}

/* Centres get a gradient of their own, since every frame has other ones. */
struct splat_gradients avatar_gradients(struct avatar *a)
{
    return (struct splat_gradients){
        .mean = a->frame_dmean, .scale = a->dall.scale,
        .quat = a->dall.quat, .opacity = a->dall.opacity,
        .color = a->dall.color
    };
}

void avatar_relative_pose(float pose[RELATIVE_POSE_SIZE],
                          const struct avatar *a, const float cam[12])
{
    relative_pose(pose, a->drive.source, a->light, cam);
}

void avatar_relative_pose_backward(float dcam[12],
                                   const float dpose[RELATIVE_POSE_SIZE],
                                   const struct avatar *a)
{
    relative_pose_backward(dcam, dpose, a->drive.source, a->light);
}
