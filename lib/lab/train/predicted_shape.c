/* E_beta's predictions as labels, with cameras moved to match. */
#include "lib/lab/train/predicted_shape.h"

#include <string.h>

int predicted_shape_open(struct predicted_shape *s, const char *path,
                         const struct head *h, struct error *err)
{
    struct model model;
    int rc;

    memset(s, 0, sizeof *s);
    if (model_open(&model, path, err))
        return -1;
    rc = encoders_open(&s->encoders, &model, true, NN_F32, err);
    model_close(&model);
    if (rc)
        return -1;
    if (shape_tta_init(&s->tta, &s->encoders.shape, h, err) == 0 &&
        shape_place_init(&s->place, h,
                         h->nshape < DATA_SHAPE ? h->nshape : DATA_SHAPE,
                         err) == 0)
        return 0;
    predicted_shape_close(s);
    return -1;
}

void predicted_shape_close(struct predicted_shape *s)
{
    shape_place_release(&s->place);
    shape_tta_release(&s->tta);
    encoders_release(&s->encoders);
}

/* t* of R (size x + place) + t* = size (R x + t). */
static void predicted_shape_move(struct motion *m, double size,
                                 const double place[3])
{
    for (int i = 0; i < 3; i++) {
        double rotated = 0;

        for (int j = 0; j < 3; j++)
            rotated += (double)m->R[3 * i + j] * place[j];
        m->t[i] = (float)(size * (double)m->t[i] - rotated);
    }
}

int predicted_shape_apply(void *ctx, struct data_person *p, struct error *err)
{
    struct predicted_shape *s = ctx;
    float truth[DATA_SHAPE];
    double size, place[3];

    _Static_assert(DATA_SHAPE == SHAPE_ENCODER_OUT, "all of the shape");
    memcpy(truth, p->shape, sizeof truth);
    if (shape_tta_forward(p->shape, &s->tta, p->frame[0].crop, data_crop,
                          &p->frame[0], err))
        return -1;
    shape_place(&size, place, p->shape, truth, &s->place);
    for (size_t i = 0; i < p->count; i++)
        predicted_shape_move(&p->frame[i].motion, size, place);
    return 0;
}
