#include "lib/train/shaper.h"

#include <string.h>

int shaper_open(struct shaper *s, const char *path, const struct head *h,
                struct error *err)
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
    if (shape_tta_init(&s->looks, &s->encoders.shape, h, err) == 0 &&
        shape_place_init(&s->place, h, h->nshape < DATA_SHAPE ? h->nshape
                                                             : DATA_SHAPE,
                         err) == 0)
        return 0;
    shaper_close(s);
    return -1;
}

void shaper_close(struct shaper *s)
{
    shape_place_release(&s->place);
    shape_tta_release(&s->looks);
    encoders_release(&s->encoders);
}

static int sample(void *ctx, float *rgb, struct square q, struct error *err)
{
    return data_sample(rgb, SHAPE_ENCODER_SIZE, ctx, q, NULL, NULL, err);
}

int shaper_look(float *beta, struct shape_tta *l, const struct data_frame *f,
                struct square q, struct error *err)
{
    return shape_tta_forward(beta, l, q, sample, (void *)f, err);
}

/* t* of R (size x + place) + t* = size (R x + t). */
static void move_camera(struct data_motion *m, double size,
                        const double place[3])
{
    for (int i = 0; i < 3; i++) {
        double turned = 0;

        for (int j = 0; j < 3; j++)
            turned += (double)m->rot[3 * i + j] * place[j];
        m->trans[i] = (float)(size * (double)m->trans[i] - turned);
    }
}

int shaper_apply(void *ctx, struct data_person *p, struct error *err)
{
    struct shaper *s = ctx;
    float truth[DATA_SHAPE];
    double size, place[3];

    _Static_assert(DATA_SHAPE == SHAPE_ENCODER_OUT, "all of the shape");
    memcpy(truth, p->shape, sizeof truth);
    if (shaper_look(p->shape, &s->looks, &p->frame[0], p->frame[0].crop,
                    err))
        return -1;
    shape_place(&size, place, p->shape, truth, &s->place);
    for (size_t i = 0; i < p->count; i++)
        move_camera(&p->frame[i].motion, size, place);
    return 0;
}
