/* The matte network (lib/net/matte_net.h): cross entropy of every pixel
 * against the coverage of people whose mask is known. */
#include <math.h>
#include <string.h>

#include "lib/lab/data/contact_sheet.h"
#include "lib/lab/data/portrait_sample.h"
#include "lib/lab/data/scenery.h"
#include "lib/net/matte_net.h"
#include "lib/lab/train/encoder_task.h"
#include "lib/lab/train/task.h"

#define PIXELS ((size_t)MATTE_SIDE * MATTE_SIDE)
#define SHEET_ROWS 3
#define SHEET_COLS 6

enum { FIGURE_IOU, FIGURE_ERROR, FIGURE_COUNT };
static const char *const figure_name[FIGURE_COUNT] = {"iou", "mean_error"};

struct impl {
    struct matte_net net;
    struct matte_net validator; /* on the same weights, for inference */
    size_t batch;
    float *rgb;                 /* (B,side,side,3) */
    float *alpha, *weight;      /* (B,side,side) */
    float *logit, *dlogit;      /* (B,side,side) */
};

static void matte_task_release(struct task *t)
{
    struct impl *m = t->impl;

    matte_net_release(&m->net);
    matte_net_release(&m->validator);
}

/* Item i of the batch from what r draws: somebody of the pool. */
static int matte_task_draw(struct task *t, size_t i, struct random *r,
                           struct error *err)
{
    struct impl *m = t->impl;
    const struct data_person *who;
    const struct data_frame *f = data_pool_draw(t->pool, &who, r);
    const struct data_frame *behind =
        t->scenery && random_chance(r, 0.5) ? scenery_draw(t->scenery, r)
                                            : data_pool_draw(t->pool, &who, r);

    return portrait_sample(m->rgb + i * PIXELS * 3, m->alpha + i * PIXELS,
                           m->weight + i * PIXELS, MATTE_SIDE, f,
                           behind, &t->config->augment, r, err);
}

/* Samples of this step, their loss, and the gradients of the weights. */
static int matte_task_pass(struct task *t, double *parts, uint64_t step,
                           size_t micro, struct error *err)
{
    struct impl *m = t->impl;
    double scale = 1 / (double)t->config->batch;

    for (size_t i = 0; i < m->batch; i++) {
        struct random r;

        data_random(&r, (uint64_t)t->config->seed, step, micro * m->batch + i);
        if (matte_task_draw(t, i, &r, err))
            return -1;
    }
    matte_net_forward(m->logit, m->rgb, &m->net);
    for (size_t i = 0; i < m->batch; i++)
        parts[0] += matte_net_loss(m->dlogit + i * PIXELS,
                                   m->logit + i * PIXELS,
                                   m->alpha + i * PIXELS,
                                   m->weight + i * PIXELS, scale, PIXELS);
    matte_net_backward(m->dlogit, &m->net);
    return 0;
}

/* The validation network sees frame k of person p into the first item; its
 * logits are in m->logit then. */
static int matte_task_predict(struct task *t, size_t p, size_t k,
                              struct error *err)
{
    const struct data_augment plain = {0};
    struct impl *m = t->impl;
    const struct data_frame *f = &t->validation[p].frame[k];
    struct random r;

    data_random(&r, 0, p, k);
    if (portrait_sample(m->rgb, m->alpha, m->weight, MATTE_SIDE, f, f, &plain,
                        &r, err))
        return -1;
    matte_net_forward(m->logit, m->rgb, &m->validator);
    return 0;
}

/* Over every frame of the validation people: intersection over union of the
 * halves, and the mean absolute error of the mattes. */
static int matte_task_validate(struct task *t, double *figures,
                               struct error *err)
{
    struct impl *m = t->impl;
    size_t both = 0, either = 0, count = 0;
    double error = 0;

    for (size_t p = 0; p < t->nvalidation; p++)
        for (size_t k = 0; k < t->validation[p].count; k++) {
            if (matte_task_predict(t, p, k, err))
                return -1;
            for (size_t i = 0; i < PIXELS; i++) {
                bool found = m->logit[i] > 0, is = m->alpha[i] > 0.5f;

                if (m->weight[i] <= 0)
                    continue;
                both += found && is;
                either += found || is;
                error += fabs(matte_net_alpha(m->logit[i]) -
                              (double)m->alpha[i]);
                count++;
            }
        }
    figures[FIGURE_IOU] = (double)both / (double)(either + !either);
    figures[FIGURE_ERROR] = error / (double)(count + !count);
    return 0;
}

/* Rows of validation people: the picture, and the person cut out of it. */
static int matte_task_sheet(struct task *t, struct contact_sheet *sh,
                            struct error *err)
{
    struct impl *m = t->impl;

    if (contact_sheet_init(sh, 2 * SHEET_ROWS, SHEET_COLS, MATTE_SIDE, err))
        return -1;
    for (size_t i = 0; i < SHEET_ROWS * SHEET_COLS && i < t->nvalidation;
         i++) {
        if (matte_task_predict(t, i, 0, err))
            return -1;
        size_t row = i / SHEET_COLS * 2, col = i % SHEET_COLS;
        contact_sheet_picture(sh, row, col, m->rgb, NULL);
        for (size_t k = 0; k < PIXELS; k++) {
            m->alpha[k] = (float)matte_net_alpha(m->logit[k]);
            for (size_t c = 0; c < 3; c++)
                m->rgb[3 * k + c] *= m->alpha[k];
        }
        contact_sheet_picture(sh, row + 1, col, m->rgb, m->alpha);
    }
    return 0;
}

/* The network, and once more for validation. */
static int matte_task_networks(struct task *t, struct error *err)
{
    struct nn_options opt = {NN_TRAIN, NN_BF16};
    struct impl *m = t->impl;

    matte_net_init(&m->net, &t->ps, "matte.", MATTE_SIDE, MATTE_WIDTH);
    if (encoder_task_fill(t, err) ||
        matte_net_plan(&m->net, m->batch, opt, err))
        return -1;
    matte_net_init(&m->validator, &t->ps, "matte.", MATTE_SIDE, MATTE_WIDTH);
    opt.mode = NN_INFER;
    return matte_net_plan(&m->validator, 1, opt, err);
}

static int matte_task_init(struct task *t, struct error *err)
{
    struct impl *m = t->impl;

    m->batch = (size_t)t->config->micro;
    m->rgb = arena_take(&t->memory, m->batch * PIXELS * 7, sizeof *m->rgb);
    if (arena_check(&t->memory, "a batch", err))
        return -1;
    m->alpha = m->rgb + 3 * m->batch * PIXELS;
    m->weight = m->alpha + m->batch * PIXELS;
    m->logit = m->weight + m->batch * PIXELS;
    m->dlogit = m->logit + m->batch * PIXELS;
    return matte_task_networks(t, err);
}

static const char *const matte_task_part[] = {"entropy"};
const struct task_type matte_task = {
    sizeof(struct impl), -1, 1, FIGURE_COUNT, matte_task_part, figure_name,
    matte_task_init, matte_task_release, matte_task_pass,
    matte_task_validate, matte_task_sheet
};
