/* E_m's confidence head (lib/net/confidence_head.h): logistic regression on the
 * pooled features of the encoder as it is, from crops in place against
 * negative samples. */
#include <string.h>

#include "lib/lab/data/negative.h"
#include "lib/lab/data/contact_sheet.h"
#include "lib/lab/data/scenery.h"
#include "lib/base/crop.h"
#include "lib/net/mobilenet.h"
#include "lib/net/confidence_head.h"
#include "lib/lab/train/encoder_task.h"
#include "lib/lab/train/task.h"

#define CROP ((size_t)CROP_NET * CROP_NET * 3)
#define SHEET_COLS 6

enum { FIGURE_REFUSED, FIGURE_CONFIDENCE, FIGURE_COUNT };
static const char *const figure_name[FIGURE_COUNT] = {
    "refused_pct", "believed_pct"
};

struct impl {
    struct mobilenet net;       /* for inference: nothing of it learns */
    struct dense head;
    size_t batch;
    float *rgb, *pooled;        /* (B,224,224,3), (B,features) */
    float *place;               /* (B,224,224,3) of a scenery */
    enum negative *how;         /* (B) */
};

static void confidence_task_release(struct task *t)
{
    struct impl *m = t->impl;

    mobilenet_release(&m->net);
}

/* Half of the crops are in place. */
static enum negative confidence_task_kind(const struct task *t,
                                          struct random *r)
{
    return random_uniform(r) < 0.5
        ? NEGATIVE_NONE
        : (enum negative)(1 + random_below(r, NEGATIVE_COUNT - 1 +
                                              (t->scenery != NULL)));
}

/* rgb (224,224,3): of as many places of a scenery as a batch has that which
 * looks most like a face, for it is the surest one that a search takes. */
static int confidence_task_scenery(float *rgb, struct task *t,
                                   struct random *r, struct error *err)
{
    struct impl *m = t->impl;
    const struct data_frame *f = scenery_draw(t->scenery, r);
    float surest = -1;

    for (size_t i = 0; i < m->batch; i++)
        if (negative_sample(m->place + i * CROP, f, NEGATIVE_SCENERY,
                            &t->config->augment, r, err))
            return -1;
    mobilenet_forward(m->pooled, m->place, &m->net);
    for (size_t i = 0; i < m->batch; i++) {
        float how = confidence_head_forward(&m->head, m->pooled +
                                                      i * m->net.features);

        if (how > surest)
            memcpy(rgb, m->place + i * CROP, CROP * sizeof *rgb);
        surest = how > surest ? how : surest;
    }
    return 0;
}

/* Faces in place and negative samples, with the truth of each. */
static int confidence_task_pass(struct task *t, double *parts, uint64_t step,
                          size_t micro, struct error *err)
{
    struct impl *m = t->impl;
    const struct train_config *c = t->config;

    for (size_t i = 0; i < m->batch; i++) {
        const struct data_person *who;
        const struct data_frame *f;
        struct random r;

        data_random(&r, (uint64_t)c->seed, step, micro * m->batch + i);
        f = data_pool_draw(t->pool, &who, &r);
        m->how[i] = confidence_task_kind(t, &r);
        if (m->how[i] == NEGATIVE_SCENERY
                ? confidence_task_scenery(m->rgb + i * CROP, t, &r, err)
                : negative_sample(m->rgb + i * CROP, f, m->how[i],
                                  &c->augment, &r, err))
            return -1;
    }
    mobilenet_forward(m->pooled, m->rgb, &m->net);
    for (size_t i = 0; i < m->batch; i++)
        parts[0] += confidence_head_loss(&m->head, m->pooled + i * m->net.features,
                                   m->how[i] == NEGATIVE_NONE,
                                   1 / (double)c->batch);
    return 0;
}

/* Crop number n of the validation people into place i of the batch. */
static int confidence_task_take(struct task *t, size_t i, size_t n,
                          struct error *err)
{
    struct impl *m = t->impl;
    const struct data_person *p = &t->validation[n % t->nvalidation];
    struct random r;

    data_random(&r, (uint64_t)t->config->seed, UINT64_MAX, n);
    m->how[i] = n / t->nvalidation % 2
        ? (enum negative)(1 + n / t->nvalidation / 2 % (NEGATIVE_COUNT - 1))
        : NEGATIVE_NONE;
    return negative_sample(m->rgb + i * CROP,
                           &p->frame[random_below(&r, (uint32_t)p->count)],
                           m->how[i], &t->config->augment, &r, err);
}

/* Of crops in place and of negatives, the share on the wrong side of a half. */
static int confidence_task_validate(struct task *t, double *figures,
                              struct error *err)
{
    struct impl *m = t->impl;
    size_t count[2] = {0}, wrong[2] = {0};
    size_t n = 2 * t->nvalidation * (NEGATIVE_COUNT - 1);

    for (size_t k = 0; k + m->batch <= n; k += m->batch) {
        for (size_t i = 0; i < m->batch; i++)
            if (confidence_task_take(t, i, k + i, err))
                return -1;
        mobilenet_forward(m->pooled, m->rgb, &m->net);
        for (size_t i = 0; i < m->batch; i++) {
            float confidence = confidence_head_forward(&m->head, m->pooled +
                                           i * m->net.features);
            int bad = m->how[i] != NEGATIVE_NONE;

            count[bad]++;
            wrong[bad] += bad ? confidence >= 0.5f : confidence < 0.5f;
        }
    }
    for (int k = 0; k < FIGURE_COUNT; k++)
        figures[k] = 100 * (double)wrong[k] / (double)(count[k] + !count[k]);
    return 0;
}

/* A row of crops of each kind, surest pictures as they come. */
static int confidence_task_sheet(struct task *t, struct contact_sheet *sh,
                                 struct error *err)
{
    struct impl *m = t->impl;
    struct random r;
    int rc = contact_sheet_init(sh, NEGATIVE_COUNT, SHEET_COLS, CROP_NET, err);

    for (size_t i = 0; i < NEGATIVE_COUNT * SHEET_COLS && !rc; i++) {
        const struct data_person *p =
            &t->validation[i % (t->nvalidation ? t->nvalidation : 1)];

        if (!t->nvalidation)
            break;
        data_random(&r, 0, UINT64_MAX - 1, i);
        rc = negative_sample(m->rgb, &p->frame[0],
                             (enum negative)(i / SHEET_COLS),
                             &t->config->augment, &r, err);
        contact_sheet_picture(sh, i / SHEET_COLS, i % SHEET_COLS, m->rgb,
                              NULL);
    }
    return rc;
}

/* Encoder and head; only the head learns. */
static int confidence_task_networks(struct task *t, struct error *err)
{
    const struct nn_options opt = {NN_INFER, NN_F32};
    struct impl *m = t->impl;
    char net[64];

    train_config_net(net, sizeof net, t->config, "motion",
                     "mobilenetv3_small_100");
    if (mobilenet_init(&m->net, &t->ps, "motion.encoder.", net, err))
        return -1;
    for (size_t i = 0; i < t->ps.count; i++)
        t->ps.tensor[i].frozen = true;
    confidence_head_init(&m->head, &t->ps, "motion.", m->net.features);
    return encoder_task_fill(t, err) ||
           mobilenet_plan(&m->net, m->batch, CROP_NET, CROP_NET, opt, err)
               ? -1 : 0;
}

static int confidence_task_init(struct task *t, struct error *err)
{
    struct impl *m = t->impl;

    m->batch = (size_t)t->config->micro;
    if (confidence_task_networks(t, err))
        return -1;
    m->how = arena_take(&t->memory, m->batch, sizeof *m->how);
    m->rgb = arena_take(&t->memory, m->batch * CROP, sizeof *m->rgb);
    m->pooled = arena_take(&t->memory, m->batch * m->net.features,
                           sizeof *m->pooled);
    m->place = arena_take(&t->memory, m->batch * CROP, sizeof *m->place);
    return arena_check(&t->memory, "a batch", err);
}

static const char *const confidence_task_part[] = {"logistic"};
const struct task_type confidence_task = {
    sizeof(struct impl), 0, 1, FIGURE_COUNT, confidence_task_part, figure_name,
    confidence_task_init, confidence_task_release, confidence_task_pass,
    confidence_task_validate, confidence_task_sheet
};
