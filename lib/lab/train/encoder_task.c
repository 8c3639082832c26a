/* Batches for the encoders: every item is drawn from numbers of its own, so
 * that it is the same on whichever process it falls. */
#include "lib/lab/train/encoder_task.h"

#include <math.h>
#include <string.h>

#include "lib/base/crop.h"

#define SHEET_ROWS 2
#define SHEET_COLS 6
#define CROP ((size_t)CROP_NET * CROP_NET * 3)

int encoder_task_init(struct encoder_task *e, struct task *t, size_t outputs,
                      struct error *err)
{
    const size_t B = (size_t)t->config->micro;

    memset(e, 0, sizeof *e);
    e->batch = B;
    e->outputs = outputs;
    e->item = arena_take(&t->memory, B, sizeof *e->item);
    e->rgb = arena_take(&t->memory, B * CROP, sizeof *e->rgb);
    e->out = arena_take(&t->memory, B * outputs, sizeof *e->out);
    e->dout = arena_take(&t->memory, B * outputs, sizeof *e->dout);
    return arena_check(&t->memory, "a batch", err);
}

/* Another frame, if there is one, of the person of item *of. */
static void encoder_task_draw_partner(struct encoder_item *k,
                                      const struct encoder_item *of,
                                      size_t last)
{
    const struct data_person *p = of->who;

    k->who = p;
    if (p->count > 1)
        last += 1 + random_below(&k->r, (uint32_t)p->count - 1);
    k->frame = &p->frame[last % p->count];
}

int encoder_task_draw(struct encoder_task *e, const struct task *t,
                      uint64_t step, size_t micro, struct error *err)
{
    const struct train_config *c = t->config;
    struct random look = {0};   /* what the last crop's colours come from */
    size_t drawn = 0;           /* the last even item's frame */

    for (size_t i = 0; i < e->batch; i++) {
        struct encoder_item *k = &e->item[i];
        const bool partner = e->pairs && i % 2;

        data_random(&k->r, (uint64_t)c->seed, step, micro * e->batch + i);
        if (partner) {
            encoder_task_draw_partner(k, k - 1, drawn);
        } else {
            k->frame = data_pool_draw(t->pool, &k->who, &k->r);
            drawn = (size_t)(k->frame - k->who->frame);
        }
        if (c->augment.roll > 0) {
            data_turn(&k->rotated, k->frame, M_PI / 180 * random_normal(&k->r)
                                            * (double)c->augment.roll);
            k->frame = &k->rotated;
        }
        k->q = data_jitter(k->frame, c->augment.jitter, &k->r);
        if (partner)
            k->r = look;
        look = k->r;
        if (data_sample(e->rgb + i * CROP, CROP_NET, k->frame, k->q,
                        &c->augment, &k->r, err))
            return -1;
    }
    return 0;
}

int encoder_task_sheet(struct task *t, struct contact_sheet *sh,
                       struct error *err)
{
    const struct encoder_task *e = t->impl;
    int rc = contact_sheet_init(sh, SHEET_ROWS, SHEET_COLS, CROP_NET, err);

    for (size_t i = 0; !rc && i < SHEET_ROWS * SHEET_COLS &&
                       i < t->nvalidation; i++) {
        const struct data_frame *f = &t->validation[i].frame[0];

        rc = data_sample(e->rgb, CROP_NET, f, f->crop, NULL, NULL, err);
        contact_sheet_picture(sh, i / SHEET_COLS, i % SHEET_COLS, e->rgb,
                              NULL);
    }
    return rc;
}

int encoder_task_fill(struct task *t, struct error *err)
{
    if (params_allocate(&t->ps, err) ||
        params_allocate_gradients(&t->ps, err))
        return -1;
    params_randomise(&t->ps, (uint64_t)t->config->seed);
    return 0;
}
