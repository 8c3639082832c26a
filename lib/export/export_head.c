/* The driven head as morph targets and joint rotations: what glTF's linear
 * skinning needs to repeat head_pose (Eqs. T_d, V_d). */
#include "lib/export/export_head.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/camera.h"
#include "lib/base/list.h"
#include "lib/base/rotation.h"
#include "lib/head/arkit.h"

#define LIDS 2

/* Unpack rows of a posing-layout direction, in metres. */
static void export_target_unblock(float *out, const struct head *h,
                                  const float *blocks, size_t per_block,
                                  size_t k)
{
    head_direction(out, h, blocks, per_block, k);
    for (size_t i = 0; i < 3 * h->V; i++)
        out[i] /= h->scale;
}

/* Expressions, lids and, if asked for, pose correctives, by name: ARKit's where
 * the head has its shapes, but what a joint makes there has a number. */
static void export_fill_targets(struct export_head *e,
                                const struct identity *id)
{
    const struct head *h = e->head;
    const bool arkit = head_has_arkit(h);
    size_t at = 0;

    for (size_t k = 0; k < e->opt.expressions; k++, at++) {
        if (arkit && k < ARKIT_COUNT && !arkit_is_rig((int)k))
            snprintf(e->name[at], sizeof *e->name, "%s", arkit_name((int)k));
        else
            snprintf(e->name[at], sizeof *e->name, "exp_%03zu", k);
        export_target_unblock(e->delta + 3 * h->V * at, h, h->exp_dirs, h->nexp,
                              k);
    }
    for (size_t k = 0; k < LIDS; k++, at++) {
        snprintf(e->name[at], sizeof *e->name, "%s",
                 arkit ? arkit_name(ARKIT_EYE_BLINK_L + (int)k)
                 : k ? "eyelid_right" : "eyelid_left");
        export_target_unblock(e->delta + 3 * h->V * at, h, id->lids, LIDS, k);
    }
    static const char *const joint[] = {"neck", "jaw", "eye_left",
                                        "eye_right"};
    for (size_t k = 0; e->opt.correctives && k < HEAD_POSE_DIRS; k++, at++) {
        snprintf(e->name[at], sizeof *e->name, "pose_%s_%zu", joint[k / 9],
                 k % 9);
        export_target_unblock(e->delta + 3 * h->V * at, h, h->pose_dirs,
                              HEAD_POSE_DIRS, k);
    }
}

int export_head_init(struct export_head *e, const struct identity *id,
                     const struct export_head_options *opt,
                     struct error *err)
{
    const struct head *h = id->head;

    memset(e, 0, sizeof *e);
    e->head = h;
    e->opt = *opt;
    /* without them the mouth of a head of scans would stay shut */
    e->opt.correctives |= head_has_arkit(h) != 0;
    if (e->opt.expressions > h->nexp)
        e->opt.expressions = h->nexp;
    e->targets = e->opt.expressions + LIDS +
                 (e->opt.correctives ? HEAD_POSE_DIRS : 0);
    if (e->targets > GLB_MAX_TARGETS)
        return error_set(err, EX_USAGE,
                         "%zu morph targets (expected at most %d)",
                         e->targets, GLB_MAX_TARGETS);
    e->position = arena_take(&e->memory, 3 * h->V, sizeof *e->position);
    e->normal = arena_take(&e->memory, 3 * h->V, sizeof *e->normal);
    e->delta = arena_take(&e->memory, e->targets * 3 * h->V, sizeof *e->delta);
    e->name = arena_take(&e->memory, e->targets, sizeof *e->name);
    if (arena_check(&e->memory, "morph targets", err)) {
        export_head_release(e);
        return -1;
    }
    export_target_unblock(e->position, h, id->shaped, 1, 0);
    head_normals(e->normal, h, e->position);
    for (size_t v = 0; v < h->V; v++) {        /* a vertex of no face */
        float *n = e->normal + 3 * v;

        if (n[0] * n[0] + n[1] * n[1] + n[2] * n[2] < 0.5f)
            n[2] = 1;
    }
    for (size_t i = 0; i < 3 * GLB_JOINTS; i++)
        e->joints[i] = id->joints[i] / h->scale;
    export_fill_targets(e, id);
    return 0;
}

void export_head_release(struct export_head *e)
{
    arena_release(&e->memory);
    free(e->time);
    free(e->weight);
    free(e->rotation);
    free(e->translation);
    memset(e, 0, sizeof *e);
}

int export_head_texture(struct export_head *e, const float *verts,
                        const float cam[12], uint8_t *png, size_t bytes,
                        struct error *err)
{
    size_t V = e->head->V;

    e->png = arena_keep(&e->memory, png, err);
    e->png_bytes = bytes;
    e->uv = arena_take(&e->memory, 2 * V, sizeof *e->uv);
    if (!e->png || arena_check(&e->memory, "the texture", err))
        return -1;
    /* in a picture of size 1 a pixel position is a texture coordinate */
    camera_project(e->uv, NULL, cam, 1, verts, V);
    return 0;
}

/* Room for one frame more. */
static int export_frames_grow(struct export_head *e, struct error *err)
{
    const struct list_column all[] = {
        {&e->time, sizeof *e->time},
        {&e->weight, e->targets * sizeof *e->weight},
        {&e->rotation, 4 * GLB_JOINTS * sizeof *e->rotation},
        {&e->translation, 3 * sizeof *e->translation}};

    return list_grow_columns(all, 4, &e->room, e->frames)
               ? error_set(err, EX_OSERR, "out of memory for frames") : 0;
}

/* glTF order x,y,z,w. */
static void export_store_quat(float *out, const float R[9])
{
    float q[4];

    rotation_to_quat(q, R);
    out[0] = q[1];
    out[1] = q[2];
    out[2] = q[3];
    out[3] = q[0];
}

/* The camera moves the root before a fixed glTF camera (right, up, backward):
 * p = D (R v + t), D = diag(1,-1,-1).  The skin turns about the root joint J,
 * so the root's translation is D (R J + t). */
static void export_store_root(float *rotation, float *translation,
                              const struct export_head *e, const float cam[12])
{
    static const float flip[3] = {1, -1, -1};
    float R[9];

    for (int i = 0; i < 3; i++) {
        float t = cam[4 * i + 3] / e->head->scale;

        for (int j = 0; j < 3; j++) {
            R[3 * i + j] = flip[i] * cam[4 * i + j];
            t += cam[4 * i + j] * e->joints[j];
        }
        translation[i] = flip[i] * t;
    }
    export_store_quat(rotation, R);
}

/* One frame's weights of the targets, in their order. */
static void export_store_weights(float *w, const struct export_head *e,
                                 const struct head_motion *m, float (*R)[9])
{
    size_t at = 0;

    for (size_t k = 0; k < e->opt.expressions; k++)
        w[at++] = m->exp ? m->exp[k] : 0;
    w[at++] = m->lid[0];
    w[at++] = m->lid[1];
    for (size_t k = 0; e->opt.correctives && k < HEAD_POSE_DIRS; k++)
        w[at++] = R[1 + k / 9][k % 9] - (k % 9 % 4 == 0);
}

int export_head_frame(struct export_head *e, const struct export_motion *m,
                      struct error *err)
{
    size_t t = e->frames;
    float R[GLB_JOINTS][9];

    if (t && !((float)m->time > e->time[t - 1]))
        return error_set(err, EX_DATAERR,
                         "time %g follows %g (expected increasing times)",
                         m->time, e->time[t - 1]);
    if (export_frames_grow(e, err))
        return -1;
    rotation_exp(R[JOINT_NECK], m->pose.neck);
    rotation_exp(R[JOINT_JAW], m->pose.jaw);
    rotation_exp(R[JOINT_EYE_LEFT], m->pose.eye);
    rotation_exp(R[JOINT_EYE_RIGHT], m->pose.eye + 3);
    float *q = e->rotation + 4 * GLB_JOINTS * t;
    export_store_root(q, e->translation + 3 * t, e, m->cam);
    for (size_t j = 1; j < GLB_JOINTS; j++)
        export_store_quat(q + 4 * j, R[j]);
    export_store_weights(e->weight + e->targets * t, e, &m->pose, R);
    e->time[t] = (float)m->time;
    e->frames++;
    return 0;
}

int export_head_write(const struct export_head *e, const char *path,
                      struct error *err)
{
    const struct head *h = e->head;
    const float *delta[GLB_MAX_TARGETS];
    const char *name[GLB_MAX_TARGETS];

    for (size_t k = 0; k < e->targets; k++) {
        delta[k] = e->delta + 3 * h->V * k;
        name[k] = e->name[k];
    }
    const struct glb_head g = {
        .V = h->V, .F = h->F, .position = e->position, .normal = e->normal,
        .faces = h->f, .joints = e->joints, .parents = h->parents,
        .weights = h->weights, .uv = e->uv, .png = e->png,
        .png_bytes = e->png_bytes, .targets = e->targets,
        .target_name = name, .target_delta = delta,
        .clip = e->opt.clip ? e->opt.clip : "clip", .frames = e->frames,
        .time = e->time, .target_weight = e->weight,
        .rotation = e->rotation, .translation = e->translation,
        .yfov = 2 * atanf(1 / CAMERA_FOCAL)};
    return glb_write_head(path, &g, err);
}
