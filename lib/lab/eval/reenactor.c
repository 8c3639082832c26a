/* Reenactment for evaluation: Phase A on a source frame, Phase B on driven
 * frames, every picture kept in float and without the shortcuts of the
 * programs, so that figures are the model's own. */
#include "lib/lab/eval/reenactor.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/camera.h"
#include "lib/net/motion_code.h"
#include "lib/splat/splat.h"
#include "lib/splat/types.h"
#include "lib/photo/place.h"

#define N MOTION_ENCODER_SIZE

int reenactor_parse_truth(unsigned *bits, const char *word, struct error *err)
{
    if (strcmp(word, "shape") == 0)
        *bits |= REENACTOR_TRUE_SHAPE;
    else if (strcmp(word, "motion") == 0)
        *bits |= REENACTOR_TRUE_MOTION;
    else
        return error_set(err, EX_USAGE, "unknown truth \"%s\" (expected "
                         "shape or motion)", word);
    return 0;
}

/* ---- making it ---------------------------------------------------------- */

/* All tensors of the model. */
static int reenactor_declare(struct reenactor *r, struct error *err)
{
    const struct avatar_config *c = &r->config;

    params_init(&r->ps);
    if (avatar_init(&r->avatar, &r->ps, c, r->head, err) ||
        (c->has_refiner &&
         refiner_init(&r->refiner, &r->ps, "refine.", &c->refiner, err)) ||
        motion_encoder_init(&r->motion, &r->ps, "motion.", c->motion_net,
                            err) ||
        shape_encoder_init(&r->shape, &r->ps, "shape.", c->shape_net, err) ||
        params_allocate(&r->ps, err))
        return -1;
    return 0;
}

/* Point the arrays into one block. */
static int reenactor_allocate(struct reenactor *r, struct error *err)
{
    const struct avatar_config *c = &r->config;
    const size_t n = c->size * c->size, V = r->head->V;
    const size_t C = c->has_refiner ? c->channels : 3;
    const size_t means = V + r->avatar.dense.E + c->plane * c->plane +
                         c->mouth * c->mouth;
    size_t part[] = {N * N * 3, n * C, n, 3 * n, 3 * n, 3 * means, 3 * V,
                     3 * V, 3 * n, TEXTURE_PHOTO * n, n};
    float **to[] = {&r->crop, &r->features, &r->alpha, &r->coarse, &r->rgb,
                    &r->means, &r->verts, &r->rest, &r->place, &r->photo,
                    &r->cover};
    size_t total = 0, count = sizeof part / sizeof *part;
    float *block;

    for (size_t i = 0; i < count; i++)
        total += part[i] = (part[i] + 15) / 16 * 16;
    block = calloc(total, sizeof *block);
    r->picture = malloc(4 * n);
    if (!block || !r->picture) {
        free(block);
        return error_set(err, EX_OSERR, "out of memory (%zu floats)", total);
    }
    for (size_t i = 0; i < count; i++) {
        *to[i] = block;
        block += part[i];
    }
    r->matte = r->picture + 3 * n;
    return 0;
}

/* A renderer of all channels, and one of three channels for each branch. */
static int reenactor_plan_splat(struct reenactor *r, struct error *err)
{
    const int S = (int)r->config.size;
    const int C = r->config.has_refiner ? (int)r->config.channels : 3;
    struct splat_options so = splat_defaults(S, S, C);

    so.exp_degree = 5;
    so.place = r->config.rgb_skip;
    if (splat_init(&r->splat, &so, err))
        return -1;
    r->has_alone = true;
    for (int b = 0; b < BRANCH_COUNT; b++) {
        so = splat_defaults(S, S, 3);
        so.branches = 1u << b;
        if (splat_init(&r->alone[b], &so, err))
            return -1;
    }
    return 0;
}

/* Everything for one picture at a time. */
static int reenactor_plan(struct reenactor *r, struct error *err)
{
    const struct nn_options opt = {NN_INFER, NN_F32};
    const size_t S = r->config.size;

    if (avatar_plan(&r->avatar, opt, err) ||
        (r->config.has_refiner &&
         refiner_plan(&r->refiner, 1, S, S, opt, err)) ||
        motion_encoder_plan(&r->motion, 1, opt, err) ||
        shape_encoder_plan(&r->shape, 1, opt, err) ||
        shape_tta_init(&r->shape_tta, &r->shape, r->head, err) ||
        motion_tta_init(&r->motion_tta, &r->motion, 1, r->head, true,
                        false, err))
        return -1;
    return reenactor_plan_splat(r, err);
}

int reenactor_init(struct reenactor *r, const struct model *m,
                   const struct head *head, struct error *err)
{
    memset(r, 0, sizeof *r);
    r->config = m->config;
    r->head = head;
    if (reenactor_declare(r, err) || model_load(&r->ps, m, "", err) ||
        reenactor_allocate(r, err) || reenactor_plan(r, err)) {
        reenactor_release(r);
        return -1;
    }
    return 0;
}

void reenactor_release(struct reenactor *r)
{
    for (int b = 0; r->has_alone && b < BRANCH_COUNT; b++)
        splat_release(&r->alone[b]);
    splat_release(&r->splat);
    identity_release(&r->id);
    if (r->config.has_refiner)
        refiner_release(&r->refiner);
    avatar_release(&r->avatar);
    shape_tta_release(&r->shape_tta);
    motion_tta_release(&r->motion_tta);
    motion_encoder_release(&r->motion);
    shape_encoder_release(&r->shape);
    params_release(&r->ps);
    texture_release(&r->texture);
    free(r->crop);              /* the block */
    free(r->picture);
    memset(r, 0, sizeof *r);
}

/* ---- Phase A ------------------------------------------------------------ */

/* beta of the source's face, or the true one, folded into r->id. */
static int reenactor_shape(struct reenactor *r, const struct data_frame *f,
                           struct error *err)
{
    float beta[SHAPE_ENCODER_OUT];
    size_t n = r->head->nshape < SHAPE_ENCODER_OUT ? r->head->nshape
                                                   : SHAPE_ENCODER_OUT;

    identity_release(&r->id);
    if (r->truth & REENACTOR_TRUE_SHAPE)
        return head_fold(&r->id, r->head, r->beta, r->head->nshape, err);
    if (shape_tta_forward(beta, &r->shape_tta, f->crop, data_crop, (void *)f,
                          err))
        return -1;
    return head_fold(&r->id, r->head, beta, n, err);
}

/* The person alone, premultiplied, for lookups. */
static int reenactor_texture(struct reenactor *r, struct error *err)
{
    const size_t S = r->config.size, n = S * S;
    uint8_t *own = calloc(n, 6);

    if (!own)
        return error_set(err, EX_OSERR, "out of memory (texture of %zu "
                         "pixels)", S);
    for (size_t i = 0; i < 3 * n; i++)
        own[i] = (uint8_t)((r->picture[i] * r->matte[i / 3] + 127) / 255);
    texture_release(&r->texture);
    int rc = texture_init(&r->texture, own, r->matte, own + 3 * n, S, err);
    free(own);
    return rc;
}

/* Picture and matte of the source from the frame's RGBA. */
static int reenactor_picture(struct reenactor *r, const struct data_frame *f,
                             struct error *err)
{
    const size_t S = r->config.size;

    if (f->size != S || f->width != S || f->height != S)
        return error_set(err, EX_DATAERR, "pictures of %zux%zu (expected "
                         "%zux%zu, the model's size)", f->size, f->size, S,
                         S);
    for (size_t i = 0; i < S * S; i++) {
        memcpy(r->picture + 3 * i, f->rgba + 4 * i, 3);
        r->matte[i] = f->rgba[4 * i + 3];
    }
    return reenactor_texture(r, err);
}

int reenactor_source(struct reenactor *r, const struct data_frame *f,
                     unsigned without, struct error *err)
{
    struct driven st = {.verts = r->verts};

    r->avatar.without = without;
    if (reenactor_shape(r, f, err) ||
        reenactor_motion(r, &st, f, f->crop, err) ||
        reenactor_picture(r, f, err))
        return -1;
    head_pose(r->verts, &r->id, &st.motion);
    identity_rest(r->rest, &r->id);
    avatar_bake(&r->avatar, &(struct avatar_source){
        .rgb = r->picture, .matte = r->matte, .verts = r->verts,
        .cam = st.cam, .rest = r->rest
    });
    memcpy(r->source_cam, st.cam, sizeof r->source_cam);
    if (splat_load(&r->splat, &r->avatar.set, err))
        return -1;
    for (int b = 0; b < BRANCH_COUNT; b++)
        if (splat_load(&r->alone[b], &r->avatar.set, err))
            return -1;
    return 0;
}

/* ---- Phase B ------------------------------------------------------------ */

int reenactor_motion(struct reenactor *r, struct driven *st,
                     const struct data_frame *f, struct square q,
                     struct error *err)
{
    if (r->truth & REENACTOR_TRUE_MOTION) {
        memcpy(st->R, f->motion.rot, sizeof st->R);
        memcpy(st->t, f->motion.trans, sizeof st->t);
        data_truth(&st->motion, st->cam, f);
        head_pose(st->verts, &r->id, &st->motion);
        return 0;
    }
    if (data_sample(r->crop, N, f, q, NULL, NULL, err))
        return -1;
    motion_tta_forward(r->out, &r->motion_tta, r->crop);
    motion_code_decode(st->R, st->t, &st->motion, r->out, q,
                       (double)f->size);
    camera_make(st->cam, st->R, st->t);
    head_pose(st->verts, &r->id, &st->motion);
    return 0;
}

struct square reenactor_follow(const struct reenactor *r,
                               const struct driven *st, size_t size)
{
    float x[3 * HEAD_LANDMARKS], uv[2 * HEAD_LANDMARKS];

    head_landmarks(x, r->head, st->verts);
    camera_project(uv, NULL, st->cam, (float)size, x, HEAD_LANDMARKS);
    return crop_from_landmarks(uv, HEAD_LANDMARKS);
}

/* Eq. C, and what the photograph shows of it; nothing where the model has no
 * places. */
static int reenactor_splat(struct reenactor *r, const float cam[12],
                           struct error *err)
{
    const size_t S = r->config.size;
    const struct splat_camera sc = splat_camera_square(cam, (int)S,
                                                       CAMERA_FOCAL);
    const bool places = r->config.rgb_skip;
    const struct splat_pictures out = {
        .image = r->features, .alpha = r->alpha,
        .place = places ? r->place : NULL
    };
    struct splat_place_view view;

    place_view_make(&view, r->source_cam, cam);
    if (splat_draw(&r->splat, &out, &sc, &view, NULL, err))
        return -1;
    if (places)
        texture_lookup(r->photo, &r->texture, &view, r->place, r->alpha, S);
    return 0;
}

/* A picture with the photograph in it. */
static void reenactor_compose(struct reenactor *r, float *rgb,
                              const float *field)
{
    const size_t S = r->config.size;
    const struct texture_field f = {field, S / TEXTURE_FIELD_STEP,
                                    S / TEXTURE_FIELD_STEP};

    memcpy(r->cover, r->alpha, S * S * sizeof *r->cover);
    texture_compose(rgb, r->cover, r->photo, &f, S, S);
}

int reenactor_draw(struct reenactor *r, const float *verts,
                   const float cam[12], struct error *err)
{
    const size_t n = r->config.size * r->config.size;
    const size_t C = r->config.has_refiner ? r->config.channels : 3;
    float turn[RELATIVE_POSE_SIZE];

    avatar_drive(r->means, &r->avatar, verts, cam);
    if (splat_update(&r->splat, r->means, 0, r->avatar.set.n, err) ||
        reenactor_splat(r, cam, err))
        return -1;
    for (size_t i = 0; i < n; i++)
        memcpy(r->coarse + 3 * i, r->features + C * i, 3 * sizeof *r->coarse);
    reenactor_compose(r, r->coarse, NULL);
    if (!r->config.has_refiner) {
        memcpy(r->rgb, r->coarse, 3 * n * sizeof *r->rgb);
        return 0;
    }
    avatar_relative_pose(turn, &r->avatar, cam);
    refiner_turn(&r->refiner, turn);
    refiner_photo(&r->refiner, r->photo);
    refiner_forward(r->rgb, r->features, &r->refiner);
    reenactor_compose(r, r->rgb, refiner_field(&r->refiner));
    return 0;
}

int reenactor_draw_branch(struct reenactor *r, float *rgb, float *alpha,
                          enum avatar_branch b, const float *verts,
                          const float cam[12], struct error *err)
{
    struct splat_camera sc = splat_camera_square(cam, (int)r->config.size,
                                                 CAMERA_FOCAL);

    avatar_drive(r->means, &r->avatar, verts, cam);
    if (splat_update(&r->alone[b], r->means, 0, r->avatar.set.n, err) ||
        splat_forward(&r->alone[b], rgb, alpha, NULL, &sc, NULL, err))
        return -1;
    return 0;
}
