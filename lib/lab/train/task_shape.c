/* E_beta alone (Section 3.3): supervised by the true shapes of rendered
 * crops, half of them mirrored. */
#include <math.h>
#include <string.h>

#include "lib/net/shape_encoder.h"
#include "lib/track/tta.h"
#include "lib/lab/train/encoder_task.h"
#include "lib/lab/train/shape_loss.h"
#include "lib/lab/train/task.h"

#define N SHAPE_ENCODER_SIZE
#define OUT SHAPE_ENCODER_OUT

struct impl {
    struct encoder_task e;
    struct shape_encoder net;
    struct shape_encoder validator; /* on the same weights, for inference */
    struct shape_tta tta; /* the validator's; its signs for a pass, too */
    struct shape_loss vertex, landmark;
    float *truth; /* (B,OUT) */
};

/* NULL before it is made. */
static void shape_task_release(struct task *t)
{
    struct impl *m = t->impl;

    shape_encoder_release(&m->net);
    shape_tta_release(&m->tta);
    shape_encoder_release(&m->validator);
    shape_loss_release(&m->vertex);
    shape_loss_release(&m->landmark);
}

/* ---- a pass ------------------------------------------------------------- */

enum { PART_VERTEX, PART_LANDMARK, PART_BETA, PARTS };

/* Add one item's losses to parts; d (OUT) is their gradient by out. */
static void shape_task_losses(double *parts, float *d, const float *out,
                              const float *truth, double scale,
                              const struct task *t)
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
static void shape_task_mirror(float *rgb, float *truth, const struct impl *m)
{
    float own[OUT];

    memcpy(own, truth, sizeof own);
    tta_mirror_picture(rgb, rgb, N);
    head_mirror_apply(truth, own, &m->tta.across);
}

/* A batch forward, its losses, and back. */
static int shape_task_pass(struct task *t, double *parts, uint64_t step,
                           size_t micro, struct error *err)
{
    struct impl *m = t->impl;
    struct encoder_task *e = &m->e;
    double scale = 1 / (double)t->config->batch;

    if (encoder_task_draw(e, t, step, micro, err))
        return -1;
    for (size_t i = 0; i < e->batch; i++) {
        struct encoder_item *k = &e->item[i];
        float *truth = m->truth + i * OUT;

        memcpy(truth, k->who->shape, sizeof k->who->shape);
        if (m->tta.mirror && random_uniform(&k->r) < 0.5)
            shape_task_mirror(e->rgb + i * N * N * 3, truth, m);
    }
    shape_encoder_forward(e->out, e->rgb, &m->net);
    for (size_t i = 0; i < e->batch; i++)
        shape_task_losses(parts, e->dout + i * OUT, e->out + i * OUT,
                          m->truth + i * OUT, scale, t);
    shape_encoder_backward(NULL, e->dout, &m->net);
    return 0;
}

/* ---- validation --------------------------------------------------------- */

/* Figures of validation, in the order of held.tsv. */
enum {
    FIGURE_VERTEX, FIGURE_MEAN, FIGURE_RATIO, FIGURE_LANDMARK, FIGURE_COUNT
};
static const char *const figure_name[FIGURE_COUNT] = {
    "shape_rms_mm", "mean_head_rms_mm", "ratio", "landmark_rms_mm"};

/* Error of the shape found from the first frame of each person, of the mean
 * head, and their ratio; of the found shape's landmarks. */
static int shape_task_validate(struct task *t, double *figures,
                               struct error *err)
{
    struct impl *m = t->impl;
    float zero[OUT] = {0}, *out = m->e.out;
    double mm = 1000 / ((double)t->head->scale * (double)t->nvalidation);

    memset(figures, 0, FIGURE_COUNT * sizeof *figures);
    for (size_t i = 0; i < t->nvalidation; i++) {
        const struct data_person *p = &t->validation[i];
        const struct data_frame *f = &p->frame[0];

        if (shape_tta_forward(out, &m->tta, f->crop, data_crop, (void *)f,
                              err))
            return -1;
        figures[FIGURE_VERTEX] += mm * shape_loss(NULL, out, p->shape,
                                                  &m->vertex);
        figures[FIGURE_MEAN] += mm * shape_loss(NULL, zero, p->shape,
                                                &m->vertex);
        figures[FIGURE_LANDMARK] += mm * shape_loss(NULL, out, p->shape,
                                                    &m->landmark);
    }
    if (figures[FIGURE_MEAN] > 0)
        figures[FIGURE_RATIO] = figures[FIGURE_VERTEX] / figures[FIGURE_MEAN];
    return 0;
}

/* ---- making it ---------------------------------------------------------- */

/* Declare, fill and plan the network, and once more for validation. */
static int shape_task_networks(struct task *t, struct error *err)
{
    const struct train_config *c = t->config;
    struct nn_options opt = {c->running_norm ? NN_FROZEN : NN_TRAIN, NN_BF16};
    struct impl *m = t->impl;
    char net[64];

    train_config_net(net, sizeof net, c, "shape",
                     "tf_mobilenetv3_large_minimal_100");
    if (shape_encoder_init(&m->net, &t->ps, "shape.", net, err) ||
        encoder_task_fill(t, err) ||
        shape_encoder_plan(&m->net, m->e.batch, opt, err) ||
        shape_encoder_init(&m->validator, &t->ps, "shape.", net, err))
        return -1;
    opt = (struct nn_options){NN_INFER, NN_F32};
    if (shape_encoder_plan(&m->validator, 1, opt, err))
        return -1;
    return shape_tta_init(&m->tta, &m->validator, t->head, err);
}

static int shape_task_init(struct task *t, struct error *err)
{
    size_t directions = t->head->nshape < OUT ? t->head->nshape : OUT;
    struct impl *m = t->impl;

    m->truth = arena_take(&t->memory, (size_t)t->config->micro * OUT,
                          sizeof *m->truth);
    if (encoder_task_init(&m->e, t, OUT, err) ||
        shape_loss_init(&m->vertex, t->head, directions, false, err) ||
        shape_loss_init(&m->landmark, t->head, directions, true, err))
        return -1;
    return shape_task_networks(t, err);
}

static const char *const shape_task_part[PARTS] = {
    [PART_VERTEX] = "vertex", [PART_LANDMARK] = "landmark",
    [PART_BETA] = "beta"
};
const struct task_type shape_task = {
    sizeof(struct impl), 1.5, PARTS, FIGURE_COUNT, shape_task_part, figure_name,
    shape_task_init, shape_task_release, shape_task_pass,
    shape_task_validate, encoder_task_sheet
};
