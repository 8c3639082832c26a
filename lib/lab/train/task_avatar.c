/* Branches, renderer and refiner by the photometric loss: with true motions
 * (stage "avatar"), or with the motion encoder's, through which the gradient
 * then flows back into it (stage "all"). */
#include <math.h>
#include <string.h>
#include <sysexits.h>

#include "lib/lab/eval/image.h"
#include "lib/net/motion_encoder.h"
#include "lib/track/tta.h"
#include "lib/lab/train/motion_loss.h"
#include "lib/lab/data/contact_sheet.h"
#include "lib/lab/train/task.h"
#include "lib/lab/train/avatar_system.h"
#include "lib/lab/train/discriminator.h"

#define N MOTION_ENCODER_SIZE

struct impl {
    struct avatar_system tr;
    bool with_motion;               /* stage "all" */
    struct motion_encoder net;
    struct motion_loss loss;
    struct motion_tta tta;          /* of E_m, unless it learns */
    struct discriminator discriminator;     /* when t->opponent */
    float *crops, *out, *dout;      /* (targets + 1,...): the source last */
};

/* Figures of validation, in the order of held.tsv. */
enum { FIGURE_PSNR, FIGURE_SSIM, FIGURE_L1, FIGURE_STAR, FIGURE_SSIM_STAR,
       FIGURE_SOURCE, FIGURE_COUNT };
static const char *const figure_name[FIGURE_COUNT] = {
    "psnr", "ssim", "l1", "psnr_star", "ssim_star", "psnr_source"};

static void avatar_task_release(struct task *t)
{
    struct impl *m = t->impl;

    avatar_system_release(&m->tr);
    discriminator_release(&m->discriminator);
    t->opponent = NULL;
    if (m->with_motion) {
        motion_tta_release(&m->tta);
        motion_encoder_release(&m->net);
        motion_loss_release(&m->loss);
    }
}

/* What one pass works on: a person, a source frame, target frames. */
struct avatar_sample {
    const struct data_person *who;
    const struct data_frame *source;
    const struct data_frame *target[64];
    struct square q[65]; /* the source's last */
    struct identity id;
};

/* The crop of item i of a sample that E_m will receive. */
static int avatar_sample_crop(struct task *t, struct avatar_sample *l,
                              size_t i, const struct data_frame *f,
                              struct random *r, struct error *err)
{
    const struct data_augment *how = &t->config->augment;
    struct impl *m = t->impl;

    l->q[i] = data_jitter(f, how->jitter, r);
    return m->with_motion ? data_sample(m->crops + i * N * N * 3, N, f,
                                        l->q[i], how, r, err)
                          : 0;
}

/* Person, source and targets of a pass, with their crops. */
static int avatar_sample_draw(struct avatar_sample *l, struct task *t,
                              uint64_t step, size_t micro, struct error *err)
{
    const struct train_config *c = t->config;
    struct random r;

    data_random(&r, (uint64_t)c->seed, step, micro);
    l->source = data_pool_draw(t->pool, &l->who, &r);
    for (int64_t i = 0; i < c->targets; i++) {
        uint32_t k = random_below(&r, (uint32_t)l->who->count);
        l->target[i] = &l->who->frame[k];
        if (avatar_sample_crop(t, l, (size_t)i, l->target[i], &r, err))
            return -1;
    }
    if (avatar_sample_crop(t, l, (size_t)c->targets, l->source, &r, err))
        return -1;
    memset(&l->id, 0, sizeof l->id);
    return head_fold(&l->id, t->head, l->who->shape, t->head->nshape, err);
}

/* What the discriminator makes of the picture drawn for frame f, whose gradient
 * joins the others, and what it learns from it. */
static void avatar_task_oppose(struct task *t, double *parts,
                               const struct data_frame *f, uint64_t step,
                               double scale)
{
    struct impl *m = t->impl;
    struct avatar_system *tr = &m->tr;
    const struct train_config *c = t->config;
    const struct box face = data_face(f, tr->image);
    double *own = parts + t->nparts - 1;    /* the watched ones follow */

    if (!t->opponent || step < t->opponent_from)
        return;
    *own += discriminator_fool(tr->drgb, tr->rgb, &face,
                               c->adversarial * scale, &m->discriminator);
    discriminator_learn(own + 1, tr->rgb, tr->target, &face,
                        c->adversarial_penalty, scale, &m->discriminator);
}

/* Draw target i, add its losses, and go back to the encoder's numbers. */
static int avatar_task_target(struct task *t, double *parts,
                              const struct avatar_sample *l, size_t i,
                              uint64_t step, struct error *err)
{
    struct impl *m = t->impl;
    struct avatar_system *tr = &m->tr;
    const struct data_frame *f = l->target[i];
    double scale = 1 / (double)(t->config->batch * t->config->targets);
    double terms[TERM_COUNT] = {0};
    struct motion_weights w = t->config->geometry;
    struct motion_state s = {.verts = tr->verts};
    struct head_motion truth;
    float cam[12];

    if (*t->config->alignment_file)     /* L_lmk is what the network sees */
        w.term[TERM_LANDMARK] = 0;
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
    if (avatar_system_draw(tr, m->with_motion ? s.verts : tr->verts, cam,
                           err) ||
        avatar_system_losses(tr, parts, f, t->config, scale, err))
        return -1;
    avatar_task_oppose(t, parts, f, step, scale);
    if (avatar_system_draw_backward(tr, err))
        return -1;
    if (m->with_motion)
        motion_decode_backward(m->dout + i * MOTION_OUT, tr->dverts, tr->dcam,
                               &s, m->out + i * MOTION_OUT, f, l->q[i],
                               &l->id);
    return 0;
}

/* Phase A as it will be: the source's own motion is E_m's, too.  The
 * bake has no gradient by it, so what compares gradients takes the truth. */
static int avatar_task_bake(struct task *t, const struct avatar_sample *l,
                            struct error *err)
{
    struct impl *m = t->impl;
    size_t n = (size_t)t->config->targets;
    struct motion_state s = {.verts = m->tr.verts};

    if (m->with_motion) {
        motion_tta_forward(m->out, &m->tta, m->crops);
        memset(m->dout, 0, (n + 1) * MOTION_OUT * sizeof *m->dout);
    }
    if (!m->with_motion || t->config->smooth)
        return avatar_system_bake(&m->tr, l->source, &l->id, NULL, NULL, err);
    motion_decode(&s, m->out + n * MOTION_OUT, l->source, l->q[n], &l->id);
    return avatar_system_bake(&m->tr, l->source, &l->id, &s.motion, s.cam, err);
}

/* One person: bake, every target forward and back, the bake's backward. */
static int avatar_task_pass(struct task *t, double *parts, uint64_t step,
                            size_t micro, struct error *err)
{
    struct impl *m = t->impl;
    struct avatar_sample l;
    size_t n = (size_t)t->config->targets;
    int rc = avatar_sample_draw(&l, t, step, micro, err);

    if (!rc)
        rc = avatar_task_bake(t, &l, err);
    for (size_t i = 0; i < n && !rc; i++)
        rc = avatar_task_target(t, parts, &l, i, step, err);
    if (!rc) {
        avatar_system_bake_backward(&m->tr);
        if (m->with_motion && !m->tta.across.known)
            motion_encoder_backward(NULL, m->dout, &m->net);
    }
    identity_release(&l.id);
    return rc;
}

/* ---- validation --------------------------------------------------------- */

/* Interleaved to planar, clamped. */
static void avatar_task_planar(float *planar, const float *rgb, size_t n)
{
    for (size_t c = 0; c < 3; c++)
        for (size_t i = 0; i < n; i++)
            planar[c * n + i] = fminf(1, fmaxf(0, rgb[3 * i + c]));
}

/* PSNR and, ssim not NULL, SSIM of rgb against target, both interleaved. */
static int avatar_task_compare(double *psnr, double *ssim, double *l1,
                               const float *rgb, const float *target, size_t S,
                               float *tmp, struct error *err)
{
    struct metric_ssim m = {0};
    float *a = tmp, *b = tmp + 3 * S * S;

    avatar_task_planar(a, target, S * S);
    avatar_task_planar(b, rgb, S * S);
    *psnr += metric_psnr(fmax(1e-10, metric_mse(a, b, 3 * S * S)));
    if (l1)
        *l1 += metric_l1(a, b, 3 * S * S);
    if (ssim && metric_ssim(&m, NULL, NULL, a, b, 3, S, S, err))
        return -1;
    if (ssim)
        *ssim += m.mean;
    return 0;
}

/* Frames of a person that validation draws. */
#define VALIDATION_FRAMES 4

/* The k-th frame that validation draws. */
static const struct data_frame *avatar_task_frame(const struct data_person *p,
                                                  size_t k)
{
    return &p->frame[(k + 1) * p->count / (VALIDATION_FRAMES + 1)];
}

/* How a frame moves id: by E_m in stage "all", else as it is.
 * Fills the avatar system's verts, and m, whose pointers last until the next
 * call. */
static int avatar_task_motion(struct task *t, struct head_motion *motion,
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
    motion_tta_forward(m->out, &m->tta, m->crops);
    motion_decode(&s, m->out, f, f->crop, id);
    *motion = s.motion;
    memcpy(cam, s.cam, sizeof s.cam);
    return 0;
}

/* Add a person's figures to sum. */
static int avatar_task_validate_person(struct task *t, double *sum,
                                       const struct data_person *p, float *tmp,
                                       struct error *err)
{
    struct impl *m = t->impl;
    struct avatar_system *tr = &m->tr;
    struct identity id = {0};
    size_t S = tr->image, n = 3 * S * S;
    float *source = tmp + 2 * n, cam[12];
    struct head_motion motion;
    int rc = -1;

    if (head_fold(&id, t->head, p->shape, t->head->nshape, err) ||
        avatar_task_motion(t, &motion, cam, &p->frame[0], &id, err) ||
        avatar_system_bake(tr, &p->frame[0], &id, &motion, cam, err) ||
        data_portrait(source, NULL, S, &p->frame[0], err))
        goto out;
    for (size_t k = 0; k < VALIDATION_FRAMES; k++) {
        const struct data_frame *f = avatar_task_frame(p, k);
        if (avatar_task_motion(t, &motion, cam, f, &id, err) ||
            avatar_system_draw(tr, tr->verts, cam, err) ||
            data_portrait(tr->target, tr->mask, S, f, err))
            goto out;
        /* what hides the person counts for nobody */
        data_mask_occluded(tr->target, tr->rgb, 3, S, f);
        data_mask_occluded(tr->coarse, tr->rgb, 3, S, f);
        data_mask_occluded(source, tr->rgb, 3, S, f);
        if (avatar_task_compare(&sum[FIGURE_PSNR], &sum[FIGURE_SSIM],
                                &sum[FIGURE_L1], tr->rgb, tr->target, S, tmp,
                                err) ||
            avatar_task_compare(&sum[FIGURE_STAR], &sum[FIGURE_SSIM_STAR],
                                NULL, tr->coarse, tr->target, S, tmp, err) ||
            avatar_task_compare(&sum[FIGURE_SOURCE], NULL, NULL, source,
                                tr->target, S, tmp, err))
            goto out;
    }
    rc = 0;
out:
    identity_release(&id);
    return rc;
}

static int avatar_task_validate(struct task *t, double *figures,
                                struct error *err)
{
    struct impl *m = t->impl;
    size_t n = 3 * m->tr.image * m->tr.image;
    struct arena a = {0};
    float *tmp = arena_take(&a, 3 * n, sizeof *tmp);
    int rc = arena_check(&a, "validation", err);

    memset(figures, 0, FIGURE_COUNT * sizeof *figures);
    for (size_t i = 0; i < t->nvalidation && !rc; i++)
        rc = avatar_task_validate_person(t, figures, &t->validation[i], tmp,
                                         err);
    for (int k = 0; k < FIGURE_COUNT; k++)
        figures[k] /= (double)(t->nvalidation * VALIDATION_FRAMES);
    arena_release(&a);
    return rc;
}

/* source, target, coarse, final, difference */
static int avatar_task_sheet_row(struct contact_sheet *sh, struct task *t,
                                 const struct data_person *p, size_t row,
                                 struct error *err)
{
    struct impl *m = t->impl;
    struct avatar_system *tr = &m->tr;
    const struct data_frame *f = avatar_task_frame(p, row % VALIDATION_FRAMES);
    struct identity id = {0};
    struct head_motion motion;
    float cam[12];
    int rc = -1;

    if (head_fold(&id, t->head, p->shape, t->head->nshape, err) ||
        avatar_task_motion(t, &motion, cam, &p->frame[0], &id, err) ||
        avatar_system_bake(tr, &p->frame[0], &id, &motion, cam, err) ||
        data_portrait(tr->target, tr->mask, tr->image, &p->frame[0], err))
        goto out;
    contact_sheet_picture(sh, row, 0, tr->target, tr->mask);
    if (avatar_task_motion(t, &motion, cam, f, &id, err) ||
        avatar_system_draw(tr, tr->verts, cam, err) ||
        data_portrait(tr->target, tr->mask, tr->image, f, err))
        goto out;
    contact_sheet_picture(sh, row, 1, tr->target, tr->mask);
    contact_sheet_picture(sh, row, 2, tr->coarse, tr->coarse_alpha);
    contact_sheet_picture(sh, row, 3, tr->rgb, tr->rgb_alpha);
    contact_sheet_difference(sh, row, 4, tr->rgb, tr->target);
    rc = 0;
out:
    identity_release(&id);
    return rc;
}

/* A row for each of the first six people. */
static int avatar_task_sheet(struct task *t, struct contact_sheet *sh,
                             struct error *err)
{
    struct impl *m = t->impl;
    size_t rows = t->nvalidation < 6 ? t->nvalidation : 6;
    int rc = contact_sheet_init(sh, rows, 5, m->tr.image, err);

    for (size_t i = 0; i < rows && !rc; i++)
        rc = avatar_task_sheet_row(sh, t, &t->validation[i], i, err);
    return rc;
}

/* ---- making it ---------------------------------------------------------- */

/* Stage "all": E_m, its crops and its terms. */
static int avatar_task_add_motion(struct task *t, const char *net,
                                  struct error *err)
{
    struct impl *m = t->impl;
    size_t T = (size_t)t->config->targets + 1;

    m->with_motion = true;
    memcpy(t->part_name + PICTURE_COUNT, motion_term_name,
           sizeof motion_term_name);
    t->nparts = PICTURE_COUNT + TERM_COUNT;
    m->crops = arena_take(&t->memory, T * N * N * 3, sizeof *m->crops);
    m->out = arena_take(&t->memory, T * MOTION_OUT, sizeof *m->out);
    m->dout = arena_take(&t->memory, T * MOTION_OUT, sizeof *m->dout);
    return arena_check(&t->memory, "crops", err) ||
           motion_encoder_init(&m->net, &t->ps, "motion.", net, err) ? -1 : 0;
}

/* The discriminator and its terms, behind all others. */
static int avatar_task_add_discriminator(struct task *t, struct error *err)
{
    const struct train_config *c = t->config;
    struct impl *m = t->impl;

    if (c->adversarial == 0)
        return 0;
    if (discriminator_init(&m->discriminator, (size_t)c->image,
                           (uint64_t)c->seed, err))
        return -1;
    t->opponent = &m->discriminator.ps;
    t->opponent_from = (uint64_t)c->adversarial_from;
    t->opponent_rate = c->adversarial_rate;
    t->part_name[t->nparts++] = "adversarial";
    t->nwatched = DISCRIMINATOR_TERMS;
    memcpy(t->part_name + t->nparts, discriminator_term_name,
           sizeof discriminator_term_name);
    return 0;
}

/* The model's configuration, the shipped one by default. */
static int avatar_task_config(struct avatar_config *model,
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

/* Plan the avatar and E_m, whose weights are there, and the losses' networks. */
static int avatar_task_plan(struct task *t, struct impl *m, struct error *err)
{
    const struct train_config *c = t->config;
    /* differences of smooth losses are taken: every digit counts */
    enum nn_type type = c->smooth ? NN_F32 : NN_BF16;
    struct nn_options train = {NN_TRAIN, type}, fixed = {NN_FROZEN, type};

    if (avatar_system_plan(&m->tr, (size_t)c->image, 1, c->smooth, train, err))
        return -1;
    if (m->with_motion) {
        motion_encoder_init_weights(&m->net);
        if (motion_encoder_plan(&m->net, (size_t)c->targets + 1, fixed, err) ||
            motion_tta_init(&m->tta, &m->net, (size_t)c->targets + 1, t->head,
                            strcmp(c->freeze, "motion.") == 0, NULL, false,
                            err) ||
            motion_loss_init(&m->loss, t->head, err))
            return -1;
    }
    nn_plans_use(NULL);         /* the losses' networks stay as they are */
    return (*c->perceptual_file &&
            avatar_system_perceptual(&m->tr, c->perceptual_file, err)) ||
           (*c->alignment_file &&
            avatar_system_alignment(&m->tr, c->alignment_file, err)) ? -1 : 0;
}

static int avatar_task_init(struct task *t, struct error *err)
{
    const struct train_config *c = t->config;
    struct impl *m = t->impl;
    struct avatar_config model;

    if (c->micro != 1)
        return error_set(err, EX_CONFIG, "micro: %lld (expected 1 in this "
                         "stage: a pass is one person)",
                         (long long)c->micro);
    if (avatar_task_config(&model, c, err) ||
        avatar_system_init(&m->tr, &t->ps, &model, t->head, err) ||
        (c->stage == STAGE_ALL &&
         avatar_task_add_motion(t, model.motion_net, err)) ||
        avatar_task_add_discriminator(t, err) ||
        params_allocate(&t->ps, err) || params_allocate_gradients(&t->ps, err))
        return -1;
    params_randomise(&t->ps, (uint64_t)c->seed);
    m->tr.fixed = !strncmp(c->learn, "refine.", strlen("refine."));
    return avatar_task_plan(t, m, err);
}

const struct task_type avatar_task = {
    sizeof(struct impl), 0, PICTURE_COUNT, FIGURE_COUNT, picture_term_name,
    figure_name, avatar_task_init, avatar_task_release, avatar_task_pass,
    avatar_task_validate, avatar_task_sheet
};
