/* E_m alone (Section 3.3): supervised by the true motions of rendered crops
 * through L_aux and L_lmk. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/lab/data/contact_sheet.h"
#include "lib/base/camera.h"
#include "lib/lab/eval/motion.h"
#include "lib/net/motion_encoder.h"
#include "lib/lab/train/encoder_task.h"
#include "lib/lab/train/motion_loss.h"
#include "lib/lab/train/task.h"

#define N MOTION_ENCODER_SIZE
#define SHEET_ROWS 4 /* people and frames of each on a contact sheet */
#define SHEET_COLS 6

struct impl {
    struct encoder_task e;
    struct motion_encoder net;
    struct motion_encoder validator; /* on the same weights, for inference */
    struct motion_loss loss;
    struct motion_error *error; /* (micro), where pairs are drawn */
    struct identity *id; /* one for each slot of the pool ... */
    uint64_t *id_of;     /* ... and 1 + the person it is of */
};

/* Figures of validation, in the order of held.tsv. */
enum {
    FIGURE_POSE, FIGURE_YAW, FIGURE_PITCH, FIGURE_ROLL, FIGURE_LANDMARK,
    FIGURE_JAW, FIGURE_BLINK, FIGURE_VERTEX, FIGURE_COUNT
};
static const char *const figure_name[FIGURE_COUNT] = {
    "pose_deg", "yaw_deg", "pitch_deg", "roll_deg", "landmark_pct",
    "jaw_corr", "blink_corr", "vertex_mm"};

static void motion_task_release(struct task *t)
{
    struct impl *m = t->impl;

    motion_encoder_release(&m->net);
    motion_encoder_release(&m->validator);
    motion_loss_release(&m->loss);
    for (size_t i = 0; m->id && i < (size_t)t->config->pool; i++)
        identity_release(&m->id[i]);
}

/* ---- a pass ------------------------------------------------------------- */

/* The identity of the person in a slot of the pool, folded when new. */
static const struct identity *motion_task_identity(struct task *t,
                                                   const struct data_person *p,
                                                   struct error *err)
{
    struct impl *m = t->impl;
    size_t slot = (size_t)(p - t->pool->person), n = t->pool->size;
    uint64_t last = t->pool->read - 1;
    uint64_t person = last - (last % n + n - slot) % n;

    if (m->id_of[slot] != person + 1) {
        identity_release(&m->id[slot]);
        m->id_of[slot] = 0;
        if (head_fold(&m->id[slot], t->head, p->shape, t->head->nshape, err))
            return NULL;
        m->id_of[slot] = person + 1;
    }
    return &m->id[slot];
}

/* Errors of a pass's items, whose odd ones are partners of those before. */
static int motion_task_errors(struct task *t, struct error *err)
{
    struct impl *m = t->impl;
    const struct encoder_task *e = &m->e;

    for (size_t i = 0; i < e->batch; i++) {
        const struct encoder_item *k = &e->item[i];

        m->loss.id = motion_task_identity(t, k->who, err);
        if (!m->loss.id)
            return -1;
        motion_error(&m->error[i], e->out + i * MOTION_OUT, k->frame, k->q,
                     &m->loss);
    }
    return 0;
}

/* A batch forward, its losses, and back. */
static int motion_task_pass(struct task *t, double *parts, uint64_t step,
                            size_t micro, struct error *err)
{
    struct impl *m = t->impl;
    struct encoder_task *e = &m->e;
    const struct train_config *c = t->config;
    struct motion_weights w = c->geometry;
    double scale = 1 / (double)c->batch, mine[TERM_COUNT] = {0};

    for (int k = 0; k < TERM_COUNT; k++)
        w.term[k] *= (float)train_anchor(c, step);
    if (encoder_task_draw(e, t, step, micro, err))
        return -1;
    motion_encoder_forward(e->out, e->rgb, &m->net);
    memset(e->dout, 0, e->batch * MOTION_OUT * sizeof *e->dout);
    if (e->pairs && motion_task_errors(t, err))
        return -1;
    for (size_t i = 0; i < e->batch; i++) {
        const struct encoder_item *k = &e->item[i];
        struct motion_state s;

        m->loss.id = motion_task_identity(t, k->who, err);
        if (!m->loss.id)
            return -1;
        m->loss.partner = e->pairs ? &m->error[i ^ 1] : NULL;
        motion_loss(e->dout + i * MOTION_OUT, mine, &s,
                    e->out + i * MOTION_OUT, k->frame, k->q, &w, scale,
                    &m->loss);
    }
    for (int k = 0; k < TERM_COUNT; k++)
        parts[k] += mine[k] * scale;
    motion_encoder_backward(NULL, e->dout, &m->net);
    return 0;
}

/* ---- validation --------------------------------------------------------- */

/* Sums over all frames of all people. */
struct score {
    double sum[FIGURE_COUNT];
    double *jaw[2], *lid[2]; /* predicted, true: all frames */
    size_t n, room;
};

/* Add what was predicted for a frame; truth (V,3) is its true mesh. */
static void motion_task_score_add(struct score *s, const float *out,
                                  const struct motion_state *st,
                                  const struct data_frame *f,
                                  const struct head *h, const float *truth)
{
    float x[68 * 3], uv[68][2];
    double e[3], et[3], eye = metric_eye_distance((const float(*)[2])f->lmk);
    struct metric_points p;

    s->sum[FIGURE_POSE] += metric_rotation_degrees(st->R, f->motion.R);
    metric_euler_degrees(e, st->R);
    metric_euler_degrees(et, f->motion.R);
    for (int k = 0; k < 3; k++)
        s->sum[FIGURE_YAW + k] += fabs(remainder(e[k] - et[k], 360));
    head_landmarks(x, h, st->verts);
    camera_project(&uv[0][0], NULL, st->cam, (float)f->size, x, 68);
    metric_points(&p, (const float(*)[2])f->lmk, (const float(*)[2])uv);
    s->sum[FIGURE_LANDMARK] += 100 * p.akd / fmax(eye, 1);
    for (size_t i = 0; i < 3 * h->V; i++)
        s->sum[FIGURE_VERTEX] += fabsf(truth[i] - st->verts[i]) * 1000 /
                                 (h->scale * (double)(3 * h->V));
    if (s->n < s->room) {
        s->jaw[0][s->n] = metric_jaw_open(out + MOTION_JAW);
        s->jaw[1][s->n] = metric_jaw_open(f->motion.pose.jaw);
        s->lid[0][s->n] = 0.5 * (out[MOTION_LID] + out[MOTION_LID + 1]);
        s->lid[1][s->n] = 0.5 * (f->motion.pose.lid[0] +
                                 f->motion.pose.lid[1]);
    }
    s->n++;
}

/* What the validation network says of frame f of person id: out (120) and its
 * motion; verts (V,3) is posed.  The crop lies in the task's first item. */
static int motion_task_predict(struct task *t, float *out,
                               struct motion_state *st,
                               const struct data_frame *f,
                               const struct identity *id, struct error *err)
{
    struct impl *m = t->impl;

    st->verts = m->loss.verts;
    if (data_sample(m->e.rgb, N, f, f->crop, NULL, NULL, err))
        return -1;
    motion_encoder_forward(out, m->e.rgb, &m->validator);
    motion_decode(st, out, f, f->crop, id);
    return 0;
}

/* Add all of a person's frames to the score. */
static int motion_task_validate_person(struct task *t, struct score *s,
                                       const struct data_person *p,
                                       struct error *err)
{
    struct impl *m = t->impl;
    struct identity id = {0};
    float out[MOTION_OUT];
    int rc = head_fold(&id, t->head, p->shape, t->head->nshape, err);

    for (size_t i = 0; rc == 0 && i < p->count; i++) {
        const struct data_frame *f = &p->frame[i];
        struct head_motion truth;
        struct motion_state st;
        float cam[12];

        rc = motion_task_predict(t, out, &st, f, &id, err);
        if (rc)
            break;
        data_truth(&truth, cam, f);
        head_pose(m->loss.truth, &id, &truth);
        motion_task_score_add(s, out, &st, f, t->head, m->loss.truth);
    }
    identity_release(&id);
    return rc;
}

/* Means of angles and distances; correlations of jaw and lids. */
static int motion_task_validate(struct task *t, double *figures,
                                struct error *err)
{
    struct score s = {0};
    double *curves;
    int rc = 0;

    for (size_t i = 0; i < t->nvalidation; i++)
        s.room += t->validation[i].count;
    curves = malloc((4 * s.room + 1) * sizeof *curves);
    if (!curves)
        return error_set(err, EX_OSERR, "out of memory");
    for (int k = 0; k < 2; k++) {
        s.jaw[k] = curves + (size_t)k * s.room;
        s.lid[k] = curves + (size_t)(2 + k) * s.room;
    }
    for (size_t i = 0; i < t->nvalidation && !rc; i++)
        rc = motion_task_validate_person(t, &s, &t->validation[i], err);
    for (int k = 0; k < FIGURE_COUNT; k++)
        figures[k] = s.sum[k] / (double)(s.n ? s.n : 1);
    figures[FIGURE_JAW] = metric_correlation(s.jaw[0], s.jaw[1], s.n);
    figures[FIGURE_BLINK] = metric_correlation(s.lid[0], s.lid[1], s.n);
    free(curves);
    return rc;
}

/* ---- contact sheet ------------------------------------------------------ */

/* One crop with its landmarks: true in green, found in red. */
static int motion_task_sheet_cell(struct contact_sheet *sh, struct task *t,
                                  const struct data_frame *f,
                                  const struct identity *id, size_t row,
                                  size_t col, struct error *err)
{
    struct impl *m = t->impl;
    struct motion_state st;
    float out[MOTION_OUT], x[68 * 3], uv[68][2];

    if (motion_task_predict(t, out, &st, f, id, err))
        return -1;
    head_landmarks(x, t->head, st.verts);
    camera_project(&uv[0][0], NULL, st.cam, (float)f->size, x, 68);
    contact_sheet_picture(sh, row, col, m->e.rgb, NULL);
    contact_sheet_points(sh, row, col, (const float(*)[2])f->lmk, f->crop,
                         CONTACT_SHEET_TRUE);
    contact_sheet_points(sh, row, col, (const float(*)[2])uv, f->crop,
                         CONTACT_SHEET_FOUND);
    return 0;
}

/* Six frames of each of the first four people. */
static int motion_task_sheet(struct task *t, struct contact_sheet *sh,
                             struct error *err)
{
    size_t rows = t->nvalidation < SHEET_ROWS ? t->nvalidation : SHEET_ROWS;
    int rc = contact_sheet_init(sh, rows ? rows : 1, SHEET_COLS, N, err);

    for (size_t i = 0; i < rows && rc == 0; i++) {
        struct identity id = {0};
        const struct data_person *p = &t->validation[i];

        rc = head_fold(&id, t->head, p->shape, t->head->nshape, err);
        for (size_t k = 0; k < SHEET_COLS && rc == 0; k++)
            rc = motion_task_sheet_cell(sh, t,
                                        &p->frame[k * p->count / SHEET_COLS],
                                        &id, i, k, err);
        identity_release(&id);
    }
    return rc;
}

/* ---- making it ---------------------------------------------------------- */

/* Declare, fill and plan the network, and once more for validation. */
static int motion_task_networks(struct task *t, struct error *err)
{
    const struct train_config *c = t->config;
    struct nn_options opt = {c->running_norm ? NN_FROZEN : NN_TRAIN, NN_BF16};
    struct impl *m = t->impl;
    char net[64];

    train_config_net(net, sizeof net, c, "motion", "mobilenetv3_small_100");
    if (motion_encoder_init(&m->net, &t->ps, "motion.", net, err) ||
        encoder_task_fill(t, err))
        return -1;
    motion_encoder_init_weights(&m->net);
    if (motion_encoder_plan(&m->net, m->e.batch, opt, err) ||
        motion_encoder_init(&m->validator, &t->ps, "motion.", net, err))
        return -1;
    opt = (struct nn_options){NN_INFER, NN_F32};
    return motion_encoder_plan(&m->validator, 1, opt, err);
}

static int motion_task_init(struct task *t, struct error *err)
{
    const struct train_config *c = t->config;
    struct impl *m = t->impl;

    m->id = arena_take(&t->memory, (size_t)c->pool, sizeof *m->id);
    m->id_of = arena_take(&t->memory, (size_t)c->pool, sizeof *m->id_of);
    m->error = arena_take(&t->memory, (size_t)c->micro, sizeof *m->error);
    if (encoder_task_init(&m->e, t, MOTION_OUT, err) ||
        motion_loss_init(&m->loss, t->head, err))
        return -1;
    m->e.pairs = c->geometry.term[TERM_CHANGE] > 0;
    if (m->e.pairs && m->e.batch % 2)
        return error_set(err, EX_CONFIG, "loss.change: a pass has %zu crops, "
                         "which are not pairs", m->e.batch);
    return motion_task_networks(t, err);
}

const struct task_type motion_task = {
    sizeof(struct impl), 1.5, TERM_COUNT, FIGURE_COUNT, motion_term_name,
    figure_name, motion_task_init, motion_task_release, motion_task_pass,
    motion_task_validate, motion_task_sheet
};
