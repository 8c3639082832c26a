/* A frame as a record of a stream: IMAG, or FEAT in float or half precision,
 * whole or only the pixels that anything covers. */
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/compose.h"
#include "formats/framesink_impl.h"
#include "lib/base/cpu.h"
#include "lib/stream/records.h"
#include "lib/splat/relight.h"

_Static_assert(FEAT_TURN == RELATIVE_POSE_SIZE, "a turn is a relative pose");
_Static_assert(FEAT_GAIN == RELIGHT_STEP, "a gain is as it is drawn");

/* RGBA in place to RGB, and the alphas apart. */
static void framesink_split_alpha(uint8_t *pixel, uint8_t *alpha, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        alpha[i] = pixel[4 * i + 3];
        memmove(pixel + 3 * i, pixel + 4 * i, 3);
    }
}

int framesink_write_imag(struct framesink *s, const struct framesink_frame *f,
                         struct error *err)
{
    const size_t N = f->width * f->height;
    const struct imag picture = {
        .height = f->height, .width = f->width, .rgb = s->pixel,
        .alpha = s->opt.alpha ? s->pixel + 4 * N : NULL
    };

    if (s->opt.alpha)
        framesink_split_alpha(s->pixel, s->pixel + 4 * N, N);
    return imag_write(s->stream, f->frame, f->time, &picture, err);
}

/* The features as halves: as drawn, or rounded here.  NULL: no memory. */
static const uint16_t *framesink_half_features(struct framesink *s,
                                               const struct framesink_frame *f,
                                               size_t n)
{
    if (!f->color)
        return f->half;
    if (n > s->half_count) {
        free(s->half);
        s->half = malloc(n * sizeof *s->half);
        s->half_count = s->half ? n : 0;
    }
    if (s->half)
        CPU_PICK(compose_kernels)->half(s->half, f->color, n);
    return s->half;
}

/* The covered pixels of f's photo, one after the other; NULL without
 * memory. */
static const float *framesink_packed_photo(struct framesink *s,
                                           const struct framesink_frame *f)
{
    const size_t N = f->width * f->height;
    float *to;

    if (s->photo_count < FEAT_PHOTO * N) {
        free(s->photo);
        s->photo = malloc(FEAT_PHOTO * N * sizeof *s->photo);
        s->photo_count = s->photo ? FEAT_PHOTO * N : 0;
    }
    to = s->photo;
    for (size_t i = 0; to && i < N; i++)
        if (f->alpha[i] != 0) {
            memcpy(to, f->photo + FEAT_PHOTO * i,
                   FEAT_PHOTO * sizeof *to);
            to += FEAT_PHOTO;
        }
    return s->photo;
}

int framesink_write_feat(struct framesink *s, const struct framesink_frame *f,
                         struct error *err)
{
    const bool half = s->opt.record == FRAMESINK_FEAT_F16;
    const size_t C = (size_t)f->channels, N = f->width * f->height;
    const bool packed = s->opt.covered && f->alpha;
    const void *feat = half ? (const void *)framesink_half_features(s, f, N * C)
                            : f->color;
    const struct covered *c = &s->covered;

    if (!feat
        || (packed
            && covered_find(&s->covered, feat, f->alpha, N,
                            C * dtype_size(half ? DTYPE_F16 : DTYPE_F32))))
        return error_set(err, EX_OSERR, "out of memory");
    const struct feat record = {
        .height = f->height, .width = f->width, .channels = C,
        .f32 = half ? NULL : feat, .f16 = half ? feat : NULL,
        .packed = packed, .pixels = packed ? c->pixels : 0,
        .alpha = f->alpha, .depth = f->depth,
        .photo = f->photo && packed ? framesink_packed_photo(s, f) : f->photo,
        .place = f->place, .map = f->place ? f->map : NULL,
        .grain = f->grain, .grain_size = f->grain_size,
        .turn = f->rotated ? f->turn : NULL, .gain = f->gain,
        .gain_height = relight_side(f->height),
        .gain_width = relight_side(f->width),
        .tint = f->tinted ? f->tint : NULL
    };
    if (!record.photo != !f->photo)
        return error_set(err, EX_OSERR, "out of memory");
    return feat_write(s->stream, f->frame, f->time, &record,
                      packed ? c->run : NULL, packed ? c->runs : 0, err);
}
