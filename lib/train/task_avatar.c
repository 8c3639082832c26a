/* Branches, renderer and refiner by the photometric loss: with true motions
 * (stage "avatar"), or with the motion encoder's, through which the gradient
 * then flows back into it (stage "all"). */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/metric/image.h"
#include "lib/net/motion_encoder.h"
#include "lib/track/tta.h"
#include "lib/train/motion_loss.h"
#include "lib/data/contact_sheet.h"
#include "lib/train/task.h"
#include "lib/train/trainee.h"

#define N MOTION_ENCODER_SIZE

struct impl {
    struct trainee tr;
    int with_motion;                /* stage "all" */
    struct motion_encoder net;
    struct motion_loss loss;
    struct motion_tta looks;      /* E_m looks twice, unless it learns */
    float *crops, *out, *dout;      /* (targets + 1,...): the source last */
};

enum { HELD_PSNR, HELD_SSIM, HELD_L1, HELD_STAR, HELD_SSIM_STAR, HELD_SOURCE,
       HELD_COUNT };
static const char *const held_name[HELD_COUNT] = {
    "psnr", "ssim", "l1", "psnr_star", "ssim_star", "psnr_source"};

static void release(struct task *t)
{
    struct impl *m = t->impl;

    if (!m)
        return;
    trainee_release(&m->tr);
    if (m->with_motion) {
        motion_tta_release(&m->looks);
        motion_encoder_release(&m->net);
        motion_loss_release(&m->loss);
    }
    free(m->crops);
    free(m);
    t->impl = NULL;
}

/* What one pass works on: a person, a source frame, target frames. */
struct lesson {
    const struct data_person *who;
    const struct data_frame *source;
    const struct data_frame *target[64];
    struct square q[65];            /* the source's last */
    struct identity id;
};

/* What E_m will see of item i of a lesson. */
static int look(struct task *t, struct lesson *l, size_t i,
                const struct data_frame *f, struct random *r,
                struct error *err)
{
    const struct data_augment *how = &t->config->augment;
    struct impl *m = t->impl;

    l->q[i] = data_jitter(f, how->jitter, r);
    return m->with_motion ? data_sample(m->crops + i * N * N * 3, N, f,
                                        l->q[i], how, r, err)
                          : 0;
}

static int draw_lesson(struct lesson *l, struct task *t, uint64_t step,
                       size_t micro, struct error *err)
{
    const struct train_config *c = t->config;
    struct random r;

    data_random(&r, (uint64_t)c->seed, step, micro);
    l->source = data_pool_draw(t->pool, &l->who, &r);
    for (int64_t i = 0; i < c->targets; i++) {
        uint32_t k = random_below(&r, (uint32_t)l->who->count);
        l->target[i] = &l->who->frame[k];
        if (look(t, l, (size_t)i, l->target[i], &r, err))
            return -1;
    }
    if (look(t, l, (size_t)c->targets, l->source, &r, err))
        return -1;
    memset(&l->id, 0, sizeof l->id);
    return head_fold(&l->id, t->head, l->who->shape, t->head->nshape, err);
}

/* Draw target i, add its losses, and go back to the encoder's numbers. */
static int study(struct task *t, double *parts, const struct lesson *l,
                 size_t i, uint64_t step, struct error *err)
{
    struct impl *m = t->impl;
    struct trainee *tr = &m->tr;
    const struct data_frame *f = l->target[i];
    double scale = 1.0 / (double)(t->config->batch * t->config->targets);
    double terms[TERM_COUNT] = {0};
    struct motion_weights w = t->config->geometry;
    struct motion_state s = {.verts = tr->verts};
    struct head_motion truth;
    float cam[12];

    if (m->with_motion) {
        float *dout = m->dout + i * MOTION_OUT, *out = m->out + i * MOTION_OUT;
        for (int k = 0; k < TERM_COUNT; k++)
            w.term[k] *= (float)train_anchor(t->config, step);
        m->loss.id = &l->id;
        motion_loss(dout, terms, &s, out, f, l->q[i], &w, scale, &m->loss);
        for (int k = 0; k < TERM_COUNT; k++)
            parts[PICTURE_COUNT + k] += terms[k] * scale;
        memcpy(cam, s.cam, sizeof cam);
    } else {
        data_truth(&truth, cam, f);
        head_pose(tr->verts, &l->id, &truth);
    }
    if (trainee_draw(tr, m->with_motion ? s.verts : tr->verts, cam, err) ||
        trainee_losses(tr, parts, f, t->config, scale, err) ||
        trainee_draw_backward(tr, err))
        return -1;
    if (m->with_motion)
        motion_decode_backward(m->dout + i * MOTION_OUT, tr->dverts,
                               tr->dcam, &s, m->out + i * MOTION_OUT, f,
                               l->q[i], &l->id);
    return 0;
}

/* Phase A as it will be: the source's own motion is what E_m sees, too.  The
 * bake has no gradient by it, so what compares gradients takes the truth. */
static int bake(struct task *t, const struct lesson *l, struct error *err)
{
    struct impl *m = t->impl;
    size_t n = (size_t)t->config->targets;
    struct motion_state s = {.verts = m->tr.verts};

    if (m->with_motion) {
        motion_tta_forward(m->out, &m->looks, m->crops);
        memset(m->dout, 0, (n + 1) * MOTION_OUT * sizeof *m->dout);
    }
    if (!m->with_motion || t->config->smooth)
        return trainee_bake(&m->tr, l->source, &l->id, NULL, NULL, err);
    motion_decode(&s, m->out + n * MOTION_OUT, l->source, l->q[n], &l->id);
    return trainee_bake(&m->tr, l->source, &l->id, &s.motion, s.cam, err);
}

static int pass(struct task *t, double *parts, uint64_t step, size_t micro,
                struct error *err)
{
    struct impl *m = t->impl;
    struct lesson l;
    size_t n = (size_t)t->config->targets;
    int rc = draw_lesson(&l, t, step, micro, err);

    if (!rc)
        rc = bake(t, &l, err);
    for (size_t i = 0; i < n && !rc; i++)
        rc = study(t, parts, &l, i, step, err);
    if (!rc) {
        trainee_bake_backward(&m->tr);
        if (m->with_motion && !m->looks.mirror)
            motion_encoder_backward(NULL, m->dout, &m->net);
    }
    identity_release(&l.id);
    return rc;
}

static void update(struct task *t)
{
    struct impl *m = t->impl;

    trainee_update(&m->tr);
    if (m->with_motion)
        motion_encoder_update(&m->net);
}

/* ---- held-out people ---------------------------------------------------- */

static void to_planar(float *planar, const float *rgb, size_t n)
{
    for (size_t c = 0; c < 3; c++)
        for (size_t i = 0; i < n; i++)
            planar[c * n + i] = fminf(1, fmaxf(0, rgb[3 * i + c]));
}

/* PSNR and, ssim not NULL, SSIM of rgb against target, both interleaved. */
static int compare(double *psnr, double *ssim, double *l1, const float *rgb,
                   const float *target, size_t S, float *tmp,
                   struct error *err)
{
    struct metric_ssim m = {0};
    float *a = tmp, *b = tmp + 3 * S * S;

    to_planar(a, target, S * S);
    to_planar(b, rgb, S * S);
    *psnr += metric_psnr(fmax(1e-10, metric_mse(a, b, 3 * S * S)));
    if (l1)
        *l1 += metric_l1(a, b, 3 * S * S);
    if (ssim && metric_ssim(&m, NULL, NULL, a, b, 3, S, S, err))
        return -1;
    if (ssim)
        *ssim += m.mean;
    return 0;
}

/* Frames of a held-out person that are looked at. */
#define HELD_FRAMES 4

static const struct data_frame *held_frame(const struct data_person *p,
                                           size_t k)
{
    return &p->frame[(k + 1) * p->count / (HELD_FRAMES + 1)];
}

/* How a frame moves id: as E_m sees it in stage "all", else as it is.
 * Fills the trainee's verts, and m, whose pointers last until the next call. */
static int motion_of(struct task *t, struct head_motion *motion,
                     float cam[12], const struct data_frame *f,
                     const struct identity *id, struct error *err)
{
    struct impl *m = t->impl;
    struct motion_state s = {.verts = m->tr.verts};

    if (!m->with_motion) {
        data_truth(motion, cam, f);
        head_pose(m->tr.verts, id, motion);
        return 0;
    }
    if (data_sample(m->crops, N, f, f->crop, NULL, NULL, err))
        return -1;
    motion_tta_forward(m->out, &m->looks, m->crops);
    motion_decode(&s, m->out, f, f->crop, id);
    *motion = s.motion;
    memcpy(cam, s.cam, sizeof s.cam);
    return 0;
}

static int judge_person(struct task *t, double *sum,
                        const struct data_person *p, float *tmp,
                        struct error *err)
{
    struct impl *m = t->impl;
    struct trainee *tr = &m->tr;
    struct identity id = {0};
    size_t S = tr->image, n = 3 * S * S;
    float *source = tmp + 2 * n, cam[12];
    struct head_motion motion;
    int rc = -1;

    if (head_fold(&id, t->head, p->shape, t->head->nshape, err) ||
        motion_of(t, &motion, cam, &p->frame[0], &id, err) ||
        trainee_bake(tr, &p->frame[0], &id, &motion, cam, err) ||
        data_portrait(source, NULL, S, &p->frame[0], err))
        goto out;
    for (size_t k = 0; k < HELD_FRAMES; k++) {
        const struct data_frame *f = held_frame(p, k);
        if (motion_of(t, &motion, cam, f, &id, err) ||
            trainee_draw(tr, tr->verts, cam, err) ||
            data_portrait(tr->target, tr->mask, S, f, err) ||
            compare(&sum[HELD_PSNR], &sum[HELD_SSIM], &sum[HELD_L1], tr->rgb,
                    tr->target, S, tmp, err) ||
            compare(&sum[HELD_STAR], &sum[HELD_SSIM_STAR], NULL, tr->coarse,
                    tr->target, S, tmp, err) ||
            compare(&sum[HELD_SOURCE], NULL, NULL, source, tr->target, S,
                    tmp, err))
            goto out;
    }
    rc = 0;
out:
    identity_release(&id);
    return rc;
}

/* Running statistics move when a network planned for training runs: keep the
 * weights of frozen tensors across what does not belong to training. */
static int held(struct task *t, double *figures, struct error *err)
{
    struct impl *m = t->impl;
    size_t n = 3 * m->tr.image * m->tr.image;
    float *tmp = malloc(3 * n * sizeof *tmp);
    float *keep = malloc((t->ps.total + 1) * sizeof *keep);
    int rc = 0;

    if (!tmp || !keep) {
        free(tmp);
        free(keep);
        return error_set(err, EX_OSERR, "out of memory");
    }
    memcpy(keep, t->ps.w, t->ps.total * sizeof *keep);
    memset(figures, 0, HELD_COUNT * sizeof *figures);
    update(t);
    for (size_t i = 0; i < t->nheld && !rc; i++)
        rc = judge_person(t, figures, &t->held[i], tmp, err);
    for (int k = 0; k < HELD_COUNT; k++)
        figures[k] /= (double)(t->nheld * HELD_FRAMES);
    memcpy(t->ps.w, keep, t->ps.total * sizeof *keep);
    free(tmp);
    free(keep);
    return rc;
}

/* ---- contact sheet ------------------------------------------------------ */

/* source, target, coarse, final, difference */
static int sheet_row(struct contact_sheet *sh, struct task *t,
                     const struct data_person *p, size_t row,
                     struct error *err)
{
    struct impl *m = t->impl;
    struct trainee *tr = &m->tr;
    const struct data_frame *f = held_frame(p, row % HELD_FRAMES);
    struct identity id = {0};
    struct head_motion motion;
    float cam[12];
    int rc = -1;

    if (head_fold(&id, t->head, p->shape, t->head->nshape, err) ||
        motion_of(t, &motion, cam, &p->frame[0], &id, err) ||
        trainee_bake(tr, &p->frame[0], &id, &motion, cam, err) ||
        data_portrait(tr->target, tr->mask, tr->image, &p->frame[0], err))
        goto out;
    contact_sheet_picture(sh, row, 0, tr->target, tr->mask);
    if (motion_of(t, &motion, cam, f, &id, err) ||
        trainee_draw(tr, tr->verts, cam, err) ||
        data_portrait(tr->target, tr->mask, tr->image, f, err))
        goto out;
    contact_sheet_picture(sh, row, 1, tr->target, tr->mask);
    contact_sheet_picture(sh, row, 2, tr->coarse, tr->alpha);
    contact_sheet_picture(sh, row, 3, tr->rgb, tr->alpha);
    contact_sheet_difference(sh, row, 4, tr->rgb, tr->target);
    rc = 0;
out:
    identity_release(&id);
    return rc;
}

static int make_sheet(struct task *t, uint8_t **rgb, size_t *H, size_t *W,
                      struct error *err)
{
    struct impl *m = t->impl;
    size_t rows = t->nheld < 6 ? t->nheld : 6;
    float *keep = malloc((t->ps.total + 1) * sizeof *keep);
    struct contact_sheet sh;
    int rc = 0;

    if (!keep || contact_sheet_init(&sh, rows, 5, m->tr.image, err)) {
        free(keep);
        return error_set(err, EX_OSERR, "out of memory");
    }
    memcpy(keep, t->ps.w, t->ps.total * sizeof *keep);
    update(t);
    for (size_t i = 0; i < rows && !rc; i++)
        rc = sheet_row(&sh, t, &t->held[i], i, err);
    memcpy(t->ps.w, keep, t->ps.total * sizeof *keep);
    free(keep);
    if (rc)
        contact_sheet_release(&sh);
    else
        contact_sheet_take(&sh, rgb, H, W);
    return rc;
}

static const struct task_type type = {
    "backbone., init., static., dynamic., mouth., refine.", 0, release, pass,
    update, held, make_sheet};

/* ---- making it ---------------------------------------------------------- */

static int add_motion(struct task *t, const char *net, struct error *err)
{
    struct impl *m = t->impl;
    size_t T = (size_t)t->config->targets + 1;

    m->with_motion = 1;
    memcpy(t->part_name + PICTURE_COUNT, motion_term_name,
           sizeof motion_term_name);
    t->nparts = PICTURE_COUNT + TERM_COUNT;
    m->crops = calloc(T * (N * N * 3 + 2 * MOTION_OUT), sizeof *m->crops);
    if (!m->crops)
        return error_set(err, EX_OSERR, "out of memory");
    m->out = m->crops + T * N * N * 3;
    m->dout = m->out + T * MOTION_OUT;
    return motion_encoder_init(&m->net, &t->ps, "motion.", net, err);
}

static int read_config(struct avatar_config *model,
                       const struct train_config *c, struct error *err)
{
    if (!c->model) {
        avatar_config_shipped(model);
        return 0;
    }
    if (avatar_config_parse(model, c->model, err))
        return error_prefix(err, "model");
    return 0;
}

int task_avatar_init(struct task *t, struct error *err)
{
    const struct train_config *c = t->config;
    struct nn_options train = {NN_TRAIN, NN_F32}, fixed = {NN_FROZEN, NN_F32};
    struct impl *m = calloc(1, sizeof *m);
    struct avatar_config model;

    if (!m)
        return error_set(err, EX_OSERR, "out of memory");
    t->impl = m;
    t->type = &type;
    t->nparts = PICTURE_COUNT;
    memcpy(t->part_name, picture_term_name, sizeof picture_term_name);
    t->nfigures = HELD_COUNT;
    memcpy(t->held_name, held_name, sizeof held_name);
    if (c->micro != 1)
        return error_set(err, EX_CONFIG, "micro: %lld (expected 1 in this "
                         "stage: a pass is one person)",
                         (long long)c->micro);
    if (read_config(&model, c, err) ||
        trainee_init(&m->tr, &t->ps, &model, t->head, err) ||
        (c->stage == STAGE_ALL && add_motion(t, model.motion_net, err)) ||
        params_allocate(&t->ps, err) ||
        params_allocate_gradients(&t->ps, err))
        return -1;
    params_randomise(&t->ps, (uint64_t)c->seed);
    if (trainee_plan(&m->tr, (size_t)c->image, 1, c->smooth, train, err))
        return -1;
    if (!m->with_motion)
        return 0;
    motion_encoder_start(&m->net);
    if (motion_encoder_plan(&m->net, (size_t)c->targets + 1, fixed, err) ||
        motion_tta_init(&m->looks, &m->net, (size_t)c->targets + 1, t->head,
                          strcmp(c->freeze, "motion.") == 0, err))
        return -1;
    return motion_loss_init(&m->loss, t->head, err);
}
