#include "lib/train/shaper.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#define N SHAPE_ENCODER_SIZE

int shaper_open(struct shaper *s, const char *model, struct error *err)
{
    memset(s, 0, sizeof *s);
    if (encoders_open(&s->encoders, model, true, NN_F32, err))
        return -1;
    s->crop = malloc(N * N * 3 * sizeof *s->crop);
    if (s->crop)
        return 0;
    shaper_close(s);
    return error_set(err, EX_OSERR, "out of memory");
}

void shaper_close(struct shaper *s)
{
    encoders_release(&s->encoders);
    free(s->crop);
    s->crop = NULL;
}

int shaper_apply(void *ctx, struct data_person *p, struct error *err)
{
    struct shaper *s = ctx;
    const struct data_frame *f = &p->frame[0];

    _Static_assert(DATA_SHAPE == SHAPE_ENCODER_OUT, "all of the shape");
    if (data_sample(s->crop, N, f, f->crop, NULL, NULL, err))
        return -1;
    shape_encoder_forward(p->shape, s->crop, &s->encoders.shape);
    return 0;
}
