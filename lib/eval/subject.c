#include "lib/eval/subject.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/safetensors.h"
#include "lib/geom/camera.h"
#include "lib/train/shaper.h"

#define N MOTION_ENCODER_SIZE

static int read_config(struct subject *s, const struct safetensors *st,
                       struct error *err)
{
    const char *json = st_meta(st, "spid");

    if (!json)
        return error_set(err, EX_DATAERR, "%s: no metadata \"spid\" "
                         "(expected a model's configuration)", st_path(st));
    if (avatar_config_parse(&s->config, json, err))
        return error_prefix(err, "%s", st_path(st));
    return 0;
}

static int declare(struct subject *s, struct error *err)
{
    params_init(&s->ps);
    return avatar_system_init(&s->tr, &s->ps, &s->config, s->head, err) ||
                   motion_encoder_init(&s->motion, &s->ps, "motion.",
                                       s->config.motion_net, err) ||
                   shape_encoder_init(&s->shape, &s->ps, "shape.",
                                      s->config.shape_net, err) ||
                   params_allocate(&s->ps, err)
               ? -1
               : 0;
}

static int plan(struct subject *s, struct error *err)
{
    struct nn_options opt = {NN_INFER, NN_F32};

    return avatar_system_plan(&s->tr, s->config.size, 0, 0, opt, err) ||
                   motion_encoder_plan(&s->motion, 1, opt, err) ||
                   shape_encoder_plan(&s->shape, 1, opt, err) ||
                   looks_init(&s->looks, &s->shape, s->head, err) ||
                   motion_looks_init(&s->motion_looks, &s->motion, 1,
                                     s->head, 0, err)
               ? -1
               : 0;
}

/* A renderer of three channels for each branch. */
static int plan_alone(struct subject *s, struct error *err)
{
    int S = (int)s->config.size;

    for (int b = 0; b < BRANCH_COUNT; b++) {
        struct splat_options so = splat_defaults(S, S, 3);
        so.branches = 1u << b;
        if (splat_init(&s->alone[b], &so, err))
            return -1;
    }
    s->has_alone = 1;
    return 0;
}

int subject_init(struct subject *s, const char *path, const struct head *h,
                 struct error *err)
{
    struct safetensors *st = st_open(path, err);
    int rc = -1;

    memset(s, 0, sizeof *s);
    if (!st)
        return -1;
    s->head = h;
    s->crop = malloc(N * N * 3 * sizeof *s->crop);
    if (!s->crop)
        error_set(err, EX_OSERR, "out of memory");
    else if (!read_config(s, st, err) && !declare(s, err) &&
             !params_load(&s->ps, st, "", err) && !plan(s, err) &&
             !plan_alone(s, err))
        rc = 0;
    st_close(st);
    if (rc)
        subject_release(s);
    return rc;
}

void subject_release(struct subject *s)
{
    for (int b = 0; s->has_alone && b < BRANCH_COUNT; b++)
        splat_release(&s->alone[b]);
    identity_release(&s->id);
    avatar_system_release(&s->tr);
    looks_release(&s->looks);
    motion_looks_release(&s->motion_looks);
    motion_encoder_release(&s->motion);
    shape_encoder_release(&s->shape);
    params_release(&s->ps);
    free(s->crop);
    memset(s, 0, sizeof *s);
}

int subject_shape(struct subject *s, struct identity *id,
                  const struct data_frame *f, struct square q,
                  struct error *err)
{
    float beta[SHAPE_ENCODER_OUT];
    size_t n = s->head->nshape < SHAPE_ENCODER_OUT ? s->head->nshape
                                                   : SHAPE_ENCODER_OUT;

    identity_release(id);
    if (s->truth & SUBJECT_TRUE_SHAPE)
        return head_fold(id, s->head, s->beta, s->head->nshape, err);
    if (shaper_look(beta, &s->looks, f, q, err))
        return -1;
    return head_fold(id, s->head, beta, n, err);
}

/* The motion the data say. */
static void know(struct motion_state *st, const struct data_frame *f,
                 const struct identity *id)
{
    memcpy(st->R, f->motion.rot, sizeof st->R);
    memcpy(st->t, f->motion.trans, sizeof st->t);
    avatar_system_truth(&st->motion, st->cam, f);
    head_pose(st->verts, id, &st->motion);
}

int subject_look(struct subject *s, struct motion_state *st,
                 const struct identity *id, const struct data_frame *f,
                 struct square q, struct error *err)
{
    if (s->truth & SUBJECT_TRUE_MOTION) {
        know(st, f, id);
        return 0;
    }
    if (data_sample(s->crop, N, f, q, NULL, NULL, err))
        return -1;
    motion_looks_see(s->out, &s->motion_looks, s->crop);
    motion_decode(st, s->out, f, q, id);
    return 0;
}

struct square subject_follow(const struct subject *s,
                             const struct motion_state *st, size_t size)
{
    float x[68 * 3], uv[68 * 2];

    head_landmarks(x, s->head, st->verts);
    camera_project(uv, NULL, st->cam, (float)size, x, 68);
    return crop_from_landmarks(uv, 68);
}

int subject_source(struct subject *s, const struct data_frame *f,
                   unsigned without, struct error *err)
{
    struct motion_state st = {.verts = s->tr.source};

    s->tr.avatar.without = without;
    if (subject_shape(s, &s->id, f, f->crop, err) ||
        subject_look(s, &st, &s->id, f, f->crop, err) ||
        avatar_system_bake(&s->tr, f, &s->id, &st.motion, st.cam, err))
        return -1;
    for (int b = 0; b < BRANCH_COUNT; b++)
        if (splat_load(&s->alone[b], &s->tr.avatar.set, err))
            return -1;
    return 0;
}

int subject_branch(struct subject *s, float *rgb, float *alpha,
                   enum avatar_branch b, const float *verts,
                   const float cam[12], struct error *err)
{
    struct avatar *a = &s->tr.avatar;
    struct splat_camera sc = splat_camera_square(cam, (int)s->config.size,
                                                 CAMERA_FOCAL);

    avatar_drive(s->tr.means, a, verts, cam);
    return splat_update(&s->alone[b], s->tr.means, 0, a->set.n, err) ||
                   splat_forward(&s->alone[b], rgb, alpha, NULL, &sc, NULL,
                                 err)
               ? -1
               : 0;
}
