/* E_m alone: supervised by the true motions of rendered crops. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/geom/camera.h"
#include "lib/metric/motion.h"
#include "lib/net/motion_encoder.h"
#include "lib/train/motion_loss.h"
#include "lib/data/contact_sheet.h"
#include "lib/train/task.h"

#define N MOTION_ENCODER_SIZE
#define MOST 256 /* items of one pass */

struct impl {
    struct motion_encoder net;
    struct params judge_ps;         /* a copy that infers, for held */
    struct motion_encoder judge;
    struct motion_loss loss;
    struct identity *id;            /* one for each slot of the pool ... */
    uint64_t *id_of;                /* ... and 1 + the person it is of */
    float *rgb, *out, *dout;        /* (micro,...) */
};

enum { HELD_POSE, HELD_YAW, HELD_PITCH, HELD_ROLL, HELD_LANDMARK, HELD_JAW,
       HELD_BLINK, HELD_VERTEX, HELD_COUNT };
static const char *const held_name[HELD_COUNT] = {
    "pose_deg", "yaw_deg", "pitch_deg", "roll_deg", "landmark_pct",
    "jaw_corr", "blink_corr", "vertex_mm"};

static void release(struct task *t)
{
    struct impl *m = t->impl;

    if (!m)
        return;
    motion_encoder_release(&m->net);
    motion_encoder_release(&m->judge);
    params_release(&m->judge_ps);
    motion_loss_release(&m->loss);
    for (size_t i = 0; m->id && i < (size_t)t->config->pool; i++)
        identity_release(&m->id[i]);
    free(m->id);
    free(m->id_of);
    free(m->rgb);
    free(m);
    t->impl = NULL;
}

/* The identity of the person in a slot of the pool, folded when new. */
static const struct identity *identity_of(struct task *t,
                                          const struct data_person *who,
                                          struct error *err)
{
    struct impl *m = t->impl;
    size_t slot = (size_t)(who - t->pool->person), n = t->pool->size;
    uint64_t last = t->pool->read - 1;
    uint64_t person = last - (last % n + n - slot) % n;

    if (m->id_of[slot] != person + 1) {
        identity_release(&m->id[slot]);
        m->id_of[slot] = 0;
        if (head_fold(&m->id[slot], t->head, who->shape, t->head->nshape,
                      err))
            return NULL;
        m->id_of[slot] = person + 1;
    }
    return &m->id[slot];
}

static int pass(struct task *t, double *parts, uint64_t step, size_t micro,
                struct error *err)
{
    struct impl *m = t->impl;
    const struct train_config *c = t->config;
    size_t B = (size_t)c->micro;
    struct motion_weights w = c->geometry;
    const struct data_frame *frame[MOST];
    const struct data_person *who[MOST];
    struct square q[MOST];
    double scale = 1.0 / (double)c->batch, mine[TERM_COUNT] = {0};

    for (int k = 0; k < TERM_COUNT; k++)
        w.term[k] *= (float)train_anchor(c, step);
    for (size_t i = 0; i < B; i++) {
        struct random r;
        data_random(&r, (uint64_t)c->seed, step, micro * B + i);
        frame[i] = data_pool_draw(t->pool, &who[i], &r);
        q[i] = data_jitter(frame[i], c->augment.jitter, &r);
        if (data_sample(m->rgb + i * N * N * 3, N, frame[i], q[i],
                        &c->augment, &r, err))
            return -1;
    }
    motion_encoder_forward(m->out, m->rgb, &m->net);
    memset(m->dout, 0, B * MOTION_OUT * sizeof *m->dout);
    for (size_t i = 0; i < B; i++) {
        struct motion_state s;
        m->loss.id = identity_of(t, who[i], err);
        if (!m->loss.id)
            return -1;
        motion_loss(m->dout + i * MOTION_OUT, mine, &s,
                    m->out + i * MOTION_OUT, frame[i], q[i], &w, scale,
                    &m->loss);
    }
    for (int k = 0; k < TERM_COUNT; k++)
        parts[k] += mine[k] * scale;
    motion_encoder_backward(NULL, m->dout, &m->net);
    return 0;
}

static void update(struct task *t)
{
    struct impl *m = t->impl;

    motion_encoder_update(&m->net);
}

/* ---- held-out people ---------------------------------------------------- */

struct score {
    double sum[HELD_COUNT];
    double *jaw[2], *lid[2];        /* predicted, true: all frames */
    size_t n, room;
};

static void add_score(struct score *s, const float *out,
                      const struct motion_state *st,
                      const struct data_frame *f, const struct head *h,
                      const float *truth)
{
    float x[68 * 3], uv[68][2];
    double e[3], et[3], eye = metric_eye_distance((const float(*)[2])f->lmk);
    struct metric_points p;

    s->sum[HELD_POSE] += metric_rotation_degrees(st->R, f->motion.rot);
    metric_euler_degrees(e, st->R);
    metric_euler_degrees(et, f->motion.rot);
    for (int k = 0; k < 3; k++)
        s->sum[HELD_YAW + k] += fabs(remainder(e[k] - et[k], 360));
    head_landmarks(x, h, st->verts);
    camera_project(&uv[0][0], NULL, st->cam, (float)f->size, x, 68);
    metric_points(&p, (const float(*)[2])f->lmk, (const float(*)[2])uv);
    s->sum[HELD_LANDMARK] += 100 * p.akd / fmax(eye, 1);
    for (size_t i = 0; i < 3 * h->V; i++)
        s->sum[HELD_VERTEX] += fabsf(truth[i] - st->verts[i]) * 1000 /
                               (h->scale * (double)(3 * h->V));
    if (s->n < s->room) {
        s->jaw[0][s->n] = metric_jaw_open(out + MOTION_JAW);
        s->jaw[1][s->n] = metric_jaw_open(f->motion.jaw);
        s->lid[0][s->n] = 0.5 * (out[MOTION_LID] + out[MOTION_LID + 1]);
        s->lid[1][s->n] = 0.5 * (f->motion.lid[0] + f->motion.lid[1]);
    }
    s->n++;
}

static int judge_person(struct task *t, struct score *s,
                        const struct data_person *p, struct error *err)
{
    struct impl *m = t->impl;
    struct identity id = {0};
    float *rgb = malloc(N * N * 3 * sizeof *rgb), out[MOTION_OUT];
    int rc = -1;

    if (!rgb) {
        error_set(err, EX_OSERR, "out of memory");
        goto out;
    }
    if (head_fold(&id, t->head, p->shape, t->head->nshape, err))
        goto out;
    for (size_t i = 0; i < p->count; i++) {
        const struct data_frame *f = &p->frame[i];
        struct head_motion truth = {.exp = f->motion.exp};
        struct motion_state st = {.verts = m->loss.verts};

        if (data_sample(rgb, N, f, f->crop, NULL, NULL, err))
            goto out;
        motion_encoder_forward(out, rgb, &m->judge);
        motion_decode(&st, out, f, f->crop, &id);
        memcpy(truth.jaw, f->motion.jaw, sizeof truth.jaw);
        memcpy(truth.eye, f->motion.eye, sizeof truth.eye);
        memcpy(truth.lid, f->motion.lid, sizeof truth.lid);
        head_pose(m->loss.truth, &id, &truth);
        add_score(s, out, &st, f, t->head, m->loss.truth);
    }
    rc = 0;
out:
    identity_release(&id);
    free(rgb);
    return rc;
}

static int held(struct task *t, double *figures, struct error *err)
{
    struct impl *m = t->impl;
    struct score s = {0};
    double *curves;
    int rc = 0;

    for (size_t i = 0; i < t->nheld; i++)
        s.room += t->held[i].count;
    curves = malloc((4 * s.room + 1) * sizeof *curves);
    if (!curves)
        return error_set(err, EX_OSERR, "out of memory");
    for (int k = 0; k < 2; k++) {
        s.jaw[k] = curves + (size_t)k * s.room;
        s.lid[k] = curves + (size_t)(2 + k) * s.room;
    }
    memcpy(m->judge_ps.w, t->ps.w, t->ps.total * sizeof *t->ps.w);
    motion_encoder_update(&m->judge);
    for (size_t i = 0; i < t->nheld && !rc; i++)
        rc = judge_person(t, &s, &t->held[i], err);
    for (int k = 0; k < HELD_COUNT; k++)
        figures[k] = s.sum[k] / (double)(s.n ? s.n : 1);
    figures[HELD_JAW] = metric_correlation(s.jaw[0], s.jaw[1], s.n);
    figures[HELD_BLINK] = metric_correlation(s.lid[0], s.lid[1], s.n);
    free(curves);
    return rc;
}

/* ---- contact sheet ------------------------------------------------------ */

/* One crop with its landmarks: true in green, found in red. */
static void draw_item(struct contact_sheet *sh, struct task *t,
                      const struct data_frame *f,
                      const struct identity *id, size_t row, size_t col)
{
    struct impl *m = t->impl;
    struct motion_state st = {.verts = m->loss.verts};
    float out[MOTION_OUT], x[68 * 3], uv[68][2];

    if (data_sample(m->rgb, N, f, f->crop, NULL, NULL, NULL))
        return;
    motion_encoder_forward(out, m->rgb, &m->judge);
    motion_decode(&st, out, f, f->crop, id);
    head_landmarks(x, t->head, st.verts);
    camera_project(&uv[0][0], NULL, st.cam, (float)f->size, x, 68);
    contact_sheet_picture(sh, row, col, m->rgb, NULL);
    contact_sheet_points(sh, row, col, (const float(*)[2])f->lmk, 68, f->crop, 0);
    contact_sheet_points(sh, row, col, (const float(*)[2])uv, 68, f->crop, 1);
}

static int make_sheet(struct task *t, uint8_t **rgb, size_t *H, size_t *W,
                      struct error *err)
{
    struct impl *m = t->impl;
    struct contact_sheet sh;
    size_t rows = t->nheld < 4 ? t->nheld : 4;

    if (contact_sheet_init(&sh, rows ? rows : 1, 6, N, err))
        return -1;
    memcpy(m->judge_ps.w, t->ps.w, t->ps.total * sizeof *t->ps.w);
    motion_encoder_update(&m->judge);
    for (size_t i = 0; i < rows; i++) {
        struct identity id = {0};
        const struct data_person *p = &t->held[i];
        if (head_fold(&id, t->head, p->shape, t->head->nshape, err)) {
            contact_sheet_release(&sh);
            return -1;
        }
        for (size_t k = 0; k < 6; k++)
            draw_item(&sh, t, &p->frame[k * p->count / 6], &id, i, k);
        identity_release(&id);
    }
    contact_sheet_take(&sh, rgb, H, W);
    return 0;
}

static const struct task_type type = {
    "motion.", 1.5, release, pass, update, held, make_sheet};

static int judge_init(struct task *t, const char *net, struct error *err)
{
    struct impl *m = t->impl;
    struct nn_options opt = {NN_INFER, NN_F32};

    params_init(&m->judge_ps);
    if (motion_encoder_init(&m->judge, &m->judge_ps, "motion.", net, err) ||
        params_allocate(&m->judge_ps, err))
        return -1;
    memcpy(m->judge_ps.w, t->ps.w, t->ps.total * sizeof *t->ps.w);
    return motion_encoder_plan(&m->judge, 1, opt, err);
}

int task_motion_init(struct task *t, struct error *err)
{
    const struct train_config *c = t->config;
    size_t B = (size_t)c->micro, n = N * N * 3;
    struct nn_options opt = {c->running_norm ? NN_FROZEN : NN_TRAIN, NN_F32};
    struct impl *m = calloc(1, sizeof *m);
    char net[64];

    if (!m)
        return error_set(err, EX_OSERR, "out of memory");
    t->impl = m;
    t->type = &type;
    if (B > MOST)
        return error_set(err, EX_CONFIG, "micro: %zu (expected at most %d "
                         "in this stage)", B, MOST);
    t->nparts = TERM_COUNT;
    memcpy(t->part_name, motion_term_name, sizeof motion_term_name);
    t->nfigures = HELD_COUNT;
    memcpy(t->held_name, held_name, sizeof held_name);
    train_config_net(net, sizeof net, c, "motion", "mobilenetv3_small_100");
    m->id = calloc((size_t)c->pool, sizeof *m->id);
    m->id_of = calloc((size_t)c->pool, sizeof *m->id_of);
    m->rgb = malloc(B * (n + 2 * MOTION_OUT) * sizeof *m->rgb);
    if (!m->id || !m->id_of || !m->rgb)
        return error_set(err, EX_OSERR, "out of memory (batch of %zu)", B);
    m->out = m->rgb + B * n;
    m->dout = m->out + B * MOTION_OUT;
    if (motion_encoder_init(&m->net, &t->ps, "motion.", net, err) ||
        params_allocate(&t->ps, err) ||
        params_allocate_gradients(&t->ps, err))
        return -1;
    params_randomise(&t->ps, (uint64_t)c->seed);
    motion_encoder_start(&m->net);
    if (motion_encoder_plan(&m->net, B, opt, err) ||
        motion_loss_init(&m->loss, t->head, err))
        return -1;
    return judge_init(t, net, err);
}
