/* Reenactment for evaluation: Phase A on a source frame, Phase B on driven
 * frames, by the library calls of the programs. */
#include "lib/lab/eval/reenactor.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/camera.h"
#include "lib/net/motion_code.h"

#define N MOTION_ENCODER_SIZE

int reenactor_parse_truth(const char *word, void *bits, struct error *err)
{
    if (strcmp(word, "shape") == 0)
        *(unsigned *)bits |= REENACTOR_TRUE_SHAPE;
    else if (strcmp(word, "motion") == 0)
        *(unsigned *)bits |= REENACTOR_TRUE_MOTION;
    else
        return error_set(err, EX_USAGE, "unknown truth \"%s\" (expected "
                         "shape or motion)", word);
    return 0;
}

/* ---- making it ---------------------------------------------------------- */

int reenactor_init(struct reenactor *r, const struct model *m,
                   const struct head *head, struct error *err)
{
    const struct baker_options bake = {.type = NN_F32};

    memset(r, 0, sizeof *r);
    r->head = head;
    r->model = m;
    r->crop = malloc(N * N * 3 * sizeof *r->crop);
    r->verts = malloc(3 * head->V * sizeof *r->verts);
    if (!r->crop || !r->verts) {
        error_set(err, EX_OSERR, "no memory for a face crop");
        goto fail;
    }
    if (encoders_open(&r->nets, m, true, NN_F32, err) ||
        shape_tta_init(&r->shape_tta, &r->nets.shape, head, err) ||
        motion_tta_init(&r->motion_tta, &r->nets.motion, 1, head, true,
                        NULL, false, err) ||
        baker_open(&r->baker, m, head, &bake, err) ||
        densify_init(&r->dense, head->f, head->F, head->V, err))
        goto fail;
    return 0;
fail:
    reenactor_release(r);
    return -1;
}

/* What was made of the last source. */
static void reenactor_drop_source(struct reenactor *r)
{
    pipeline_release(&r->full);
    pipeline_release(&r->star);
    for (int b = 0; b < BRANCH_COUNT; b++)
        pipeline_release(&r->alone[b]);
    texture_release(&r->texture);
    baked_release(&r->baked);
    identity_release(&r->id);
    person_release(&r->person);
}

void reenactor_release(struct reenactor *r)
{
    reenactor_drop_source(r);
    densify_release(&r->dense);
    baker_release(&r->baker);
    shape_tta_release(&r->shape_tta);
    motion_tta_release(&r->motion_tta);
    encoders_release(&r->nets);
    free(r->crop);
    free(r->verts);
    memset(r, 0, sizeof *r);
}

/* ---- Phase A ------------------------------------------------------------ */

/* beta of the source's face, or the true one. */
static int reenactor_shape(struct reenactor *r, const struct data_frame *f,
                           struct error *err)
{
    struct person *p = &r->person;
    const bool truth = r->truth & REENACTOR_TRUE_SHAPE;
    float beta[SHAPE_ENCODER_OUT];

    p->nshape = r->head->nshape;
    if (!truth && p->nshape > SHAPE_ENCODER_OUT)
        p->nshape = SHAPE_ENCODER_OUT;
    p->shape = malloc((p->nshape + 1) * sizeof *p->shape);
    if (!p->shape)
        return error_set(err, EX_OSERR, "no memory for a shape");
    if (!truth && shape_tta_forward(beta, &r->shape_tta, f->crop, data_crop,
                                    (void *)f, err))
        return -1;
    memcpy(p->shape, truth ? r->beta : beta, p->nshape * sizeof *p->shape);
    return person_fold(&r->id, r->head, p, err);
}

/* The head again, once the bake has said how it differs from its shape. */
static int reenactor_offset(struct reenactor *r, struct error *err)
{
    if (!r->person.offset)
        return 0;
    identity_release(&r->id);
    return person_fold(&r->id, r->head, &r->person, err);
}

/* Pipelines of the baked source: the refined picture, the coarse one, and
 * each branch as it is baked. */
static int reenactor_open_pipelines(struct reenactor *r, struct error *err)
{
    struct pipeline_avatar avatar = {&r->id, &r->baked, &r->dense,
                                     &r->texture};
    struct pipeline_options opt = {
        .size = r->model->config.size, .model = r->model,
        .rules = SPLAT_GSPLAT, .f32 = true, .precision = NN_F32
    };

    r->texture.grain = r->baked.grain;
    r->texture.grain_size = r->baked.grain_size;
    if (!baked_has_places(&r->baked))
        avatar.texture = NULL;
    if (r->model->config.has_refiner &&
        pipeline_init(&r->full, &opt, &avatar, err))
        return -1;
    opt.star = true;
    if (pipeline_init(&r->star, &opt, &avatar, err))
        return -1;
    avatar.texture = NULL;
    for (int b = 0; b < BRANCH_COUNT; b++) {
        opt.branches = 1u << b;
        if (pipeline_init(&r->alone[b], &opt, &avatar, err))
            return -1;
    }
    return 0;
}

int reenactor_source(struct reenactor *r, const struct data_frame *f,
                     unsigned without, struct error *err)
{
    struct driven st = {.verts = r->verts};
    struct person *p = &r->person;

    reenactor_drop_source(r);
    r->baker.avatar.without =
        without | avatar_config_without(&r->model->config);
    if (data_source(p, f, r->model->config.size, err) ||
        reenactor_shape(r, f, err) ||
        reenactor_motion(r, &st, f, f->crop, err))
        return -1;
    p->source = st.motion;
    p->source.pose.exp = p->source.exp;
    p->has_source = true;
    return light_of_crop(&p->source, &r->nets.light, f->crop, data_crop,
                         (void *)f, err) ||
           baker_bake(&r->baker, r->verts, p, err) ||
           baker_copy(&r->baked, &r->baker, true, err) ||
           reenactor_offset(r, err) ||
           texture_init(&r->texture, p->rgb, p->matte, p->back, p->size,
                        err) ||
           reenactor_open_pipelines(r, err) ? -1 : 0;
}

/* ---- Phase B ------------------------------------------------------------ */

int reenactor_motion(struct reenactor *r, struct driven *st,
                     const struct data_frame *f, struct square q,
                     struct error *err)
{
    struct motion *m = &st->motion;
    float out[MOTION_OUT];

    if (r->truth & REENACTOR_TRUE_MOTION) {
        *m = f->motion;
    } else {
        memset(m, 0, sizeof *m);
        if (data_sample(r->crop, N, f, q, NULL, NULL, err))
            return -1;
        motion_tta_forward(out, &r->motion_tta, r->crop);
        motion_code_decode(m->R, m->t, &m->pose, out, q, (double)f->size);
        memcpy(m->exp, m->pose.exp, r->head->nexp * sizeof *m->exp);
    }
    m->pose.exp = m->exp;
    motion_camera(st->cam, m);
    head_pose(st->verts, &r->id, &m->pose);
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

int reenactor_draw(struct reenactor *r, const struct motion *m,
                   struct error *err)
{
    const bool refined = r->model->config.has_refiner;

    if (pipeline_draw(&r->star, m, err) ||
        (refined && pipeline_draw(&r->full, m, err)))
        return -1;
    r->coarse = r->star.canvas.image;
    r->rgb = refined ? r->full.refined.rgb : r->coarse;
    return 0;
}

int reenactor_draw_branch(const float **rgb, struct reenactor *r,
                          enum avatar_branch b, const struct motion *m,
                          struct error *err)
{
    *rgb = r->alone[b].canvas.image;
    return pipeline_draw(&r->alone[b], m, err);
}
