#include "lib/train/shaper.h"

#include <string.h>

int shaper_open(struct shaper *s, const char *model, const struct head *h,
                struct error *err)
{
    memset(s, 0, sizeof *s);
    if (encoders_open(&s->encoders, model, true, NN_F32, err))
        return -1;
    if (looks_init(&s->looks, &s->encoders.shape, h, err) == 0)
        return 0;
    shaper_close(s);
    return -1;
}

void shaper_close(struct shaper *s)
{
    looks_release(&s->looks);
    encoders_release(&s->encoders);
}

static int sample(void *ctx, float *rgb, struct square q, struct error *err)
{
    return data_sample(rgb, SHAPE_ENCODER_SIZE, ctx, q, NULL, NULL, err);
}

int shaper_look(float *beta, struct looks *l, const struct data_frame *f,
                struct error *err)
{
    return looks_shape(beta, l, f->crop, sample, (void *)f, err);
}

int shaper_apply(void *ctx, struct data_person *p, struct error *err)
{
    struct shaper *s = ctx;

    _Static_assert(DATA_SHAPE == SHAPE_ENCODER_OUT, "all of the shape");
    return shaper_look(p->shape, &s->looks, &p->frame[0], err);
}
