/* E_beta alone: supervised by the true shapes of rendered crops. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/net/shape_encoder.h"
#include "lib/train/shape_loss.h"
#include "lib/train/shaper.h"
#include "lib/data/contact_sheet.h"
#include "lib/train/task.h"

#define N SHAPE_ENCODER_SIZE
#define OUT SHAPE_ENCODER_OUT

struct impl {
    struct shape_encoder net;
    struct params judge_ps;
    struct shape_encoder judge;
    struct shape_tta looks;         /* the judge's; its signs for pass, too */
    struct shape_loss vertex, landmark;
    float *rgb, *out, *dout, *truth;
};

static void release(struct task *t)
{
    struct impl *m = t->impl;

    if (!m)
        return;
    shape_encoder_release(&m->net);
    shape_tta_release(&m->looks);
    shape_encoder_release(&m->judge);
    params_release(&m->judge_ps);
    shape_loss_release(&m->vertex);
    shape_loss_release(&m->landmark);
    free(m->rgb);
    free(m);
    t->impl = NULL;
}

enum { PART_VERTEX, PART_LANDMARK, PART_BETA, PARTS };

/* Add one person's losses to parts; d (OUT) is their gradient by out. */
static void lesson(double *parts, float *d, const float *out,
                   const float *truth, double scale, const struct task *t)
{
    const struct impl *m = t->impl;
    const float *term = t->config->geometry.term;
    double vertex = scale * (double)term[TERM_VERTEX];
    double landmark = scale * (double)term[TERM_LANDMARK];
    double direct = scale * (double)term[TERM_EXP] / OUT;
    double gv[OUT] = {0}, gl[OUT] = {0};

    parts[PART_VERTEX] += vertex * shape_loss(gv, out, truth, &m->vertex);
    parts[PART_LANDMARK] += landmark * shape_loss(gl, out, truth,
                                                  &m->landmark);
    for (size_t k = 0; k < OUT; k++) {
        double e = (double)out[k] - truth[k];
        parts[PART_BETA] += direct * fabs(e);
        d[k] = (float)(direct * ((e > 0) - (e < 0)) + vertex * gv[k] +
                       landmark * gl[k]);
    }
}

/* The person as the mirror shows them. */
static void mirror(float *rgb, float *truth, const struct impl *m)
{
    float own[OUT];

    memcpy(own, truth, sizeof own);
    tta_mirror_picture(rgb, rgb, N);
    head_mirror_apply(truth, own, &m->looks.across);
}

static int pass(struct task *t, double *parts, uint64_t step, size_t micro,
                struct error *err)
{
    struct impl *m = t->impl;
    const struct train_config *c = t->config;
    size_t B = (size_t)c->micro;
    const struct data_person *who;
    double scale = 1.0 / (double)c->batch;

    for (size_t i = 0; i < B; i++) {
        struct random r;
        const struct data_frame *f;
        float *rgb = m->rgb + i * N * N * 3;

        data_random(&r, (uint64_t)c->seed, step, micro * B + i);
        f = data_pool_draw(t->pool, &who, &r);
        if (data_sample(rgb, N, f, data_jitter(f, c->augment.jitter, &r),
                        &c->augment, &r, err))
            return -1;
        memcpy(m->truth + i * OUT, who->shape, sizeof who->shape);
        if (m->looks.mirror && random_uniform(&r) < 0.5)
            mirror(rgb, m->truth + i * OUT, m);
    }
    shape_encoder_forward(m->out, m->rgb, &m->net);
    for (size_t i = 0; i < B; i++)
        lesson(parts, m->dout + i * OUT, m->out + i * OUT,
               m->truth + i * OUT, scale, t);
    shape_encoder_backward(NULL, m->dout, &m->net);
    return 0;
}

static void update(struct task *t)
{
    struct impl *m = t->impl;

    shape_encoder_update(&m->net);
}

enum { HELD_VERTEX, HELD_MEAN, HELD_RATIO, HELD_LANDMARK, HELD_COUNT };
static const char *const held_name[HELD_COUNT] = {
    "shape_rms_mm", "mean_head_rms_mm", "ratio", "landmark_rms_mm"};

/* Error of the shape found from the first frame of each person, of the mean
 * head, and their ratio; of the found shape's landmarks. */
static int held(struct task *t, double *figures, struct error *err)
{
    struct impl *m = t->impl;
    float zero[OUT] = {0};
    double mm = 1000 / ((double)t->head->scale * (double)t->nheld);

    memcpy(m->judge_ps.w, t->ps.w, t->ps.total * sizeof *t->ps.w);
    shape_encoder_update(&m->judge);
    memset(figures, 0, HELD_COUNT * sizeof *figures);
    for (size_t i = 0; i < t->nheld; i++) {
        const struct data_person *p = &t->held[i];
        const struct data_frame *f = &p->frame[0];
        if (shaper_look(m->out, &m->looks, f, f->crop, err))
            return -1;
        figures[HELD_VERTEX] += mm * shape_loss(NULL, m->out, p->shape,
                                                &m->vertex);
        figures[HELD_MEAN] += mm * shape_loss(NULL, zero, p->shape,
                                              &m->vertex);
        figures[HELD_LANDMARK] += mm * shape_loss(NULL, m->out, p->shape,
                                                  &m->landmark);
    }
    if (figures[HELD_MEAN] > 0)
        figures[HELD_RATIO] = figures[HELD_VERTEX] / figures[HELD_MEAN];
    return 0;
}

/* The crops E_beta sees; there is nothing to draw on them. */
static int make_sheet(struct task *t, uint8_t **rgb, size_t *H, size_t *W,
                      struct error *err)
{
    struct impl *m = t->impl;
    struct contact_sheet sh;

    if (contact_sheet_init(&sh, 2, 6, N, err))
        return -1;
    for (size_t i = 0; i < 12 && i < t->nheld; i++) {
        const struct data_frame *f = &t->held[i].frame[0];
        if (data_sample(m->rgb, N, f, f->crop, NULL, NULL, err)) {
            contact_sheet_release(&sh);
            return -1;
        }
        contact_sheet_picture(&sh, i / 6, i % 6, m->rgb, NULL);
    }
    contact_sheet_take(&sh, rgb, H, W);
    return 0;
}

static const struct task_type type = {
    "shape.", 1.5, release, pass, update, held, make_sheet};

static int judge_init(struct task *t, const char *net, struct error *err)
{
    struct impl *m = t->impl;
    struct nn_options opt = {NN_INFER, NN_F32};

    params_init(&m->judge_ps);
    if (shape_encoder_init(&m->judge, &m->judge_ps, "shape.", net, err) ||
        params_allocate(&m->judge_ps, err))
        return -1;
    memcpy(m->judge_ps.w, t->ps.w, t->ps.total * sizeof *t->ps.w);
    if (shape_encoder_plan(&m->judge, 1, opt, err))
        return -1;
    return shape_tta_init(&m->looks, &m->judge, t->head, err);
}

int task_shape_init(struct task *t, struct error *err)
{
    const struct train_config *c = t->config;
    size_t B = (size_t)c->micro, n = N * N * 3;
    size_t directions = t->head->nshape < OUT ? t->head->nshape : OUT;
    struct nn_options opt = {c->running_norm ? NN_FROZEN : NN_TRAIN, NN_F32};
    struct impl *m = calloc(1, sizeof *m);
    char net[64];

    if (!m)
        return error_set(err, EX_OSERR, "out of memory");
    t->impl = m;
    t->type = &type;
    t->nparts = PARTS;
    t->part_name[PART_VERTEX] = "vertex";
    t->part_name[PART_LANDMARK] = "landmark";
    t->part_name[PART_BETA] = "beta";
    t->nfigures = HELD_COUNT;
    memcpy(t->held_name, held_name, sizeof held_name);
    train_config_net(net, sizeof net, c, "shape", "tf_mobilenetv3_large_minimal_100");
    m->rgb = malloc(B * (n + 3 * OUT) * sizeof *m->rgb);
    if (!m->rgb)
        return error_set(err, EX_OSERR, "out of memory (batch of %zu)", B);
    m->out = m->rgb + B * n;
    m->dout = m->out + B * OUT;
    m->truth = m->dout + B * OUT;
    if (shape_loss_vertices(&m->vertex, t->head, directions, err) ||
        shape_loss_landmarks(&m->landmark, t->head, directions, err) ||
        shape_encoder_init(&m->net, &t->ps, "shape.", net, err) ||
        params_allocate(&t->ps, err) ||
        params_allocate_gradients(&t->ps, err))
        return -1;
    params_randomise(&t->ps, (uint64_t)c->seed);
    if (shape_encoder_plan(&m->net, B, opt, err))
        return -1;
    return judge_init(t, net, err);
}
