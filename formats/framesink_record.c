/* A frame as a record of a stream: IMAG, or FEAT in float or half precision,
 * whole or only the pixels that anything covers. */
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/compose.h"
#include "formats/framesink_impl.h"

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
    struct array a[2];
    int n = 1;

    a[0] = array_make("rgb", DTYPE_U8, s->pixel, 3, f->height, f->width, 3,
                      0);
    if (s->opt.alpha) {
        framesink_split_alpha(s->pixel, s->pixel + 4 * N, N);
        a[n++] = array_make("alpha", DTYPE_U8, s->pixel + 4 * N, 2,
                            f->height, f->width, 0, 0);
    }
    return stream_write(s->stream, RECORD_IMAG, f->frame, f->time, a, n, err);
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
        compose_table()->half(s->half, f->color, n);
    return s->half;
}

/* The covered pixels of f's photo, one after the other; NULL without
 * memory. */
static const float *framesink_packed_photo(struct framesink *s,
                                           const struct framesink_frame *f)
{
    const size_t N = f->width * f->height;
    float *to;

    if (s->photo_count < FRAMESINK_PHOTO * N) {
        free(s->photo);
        s->photo = malloc(FRAMESINK_PHOTO * N * sizeof *s->photo);
        s->photo_count = s->photo ? FRAMESINK_PHOTO * N : 0;
    }
    to = s->photo;
    for (size_t i = 0; to && i < N; i++)
        if (f->alpha[i] != 0) {
            memcpy(to, f->photo + FRAMESINK_PHOTO * i,
                   FRAMESINK_PHOTO * sizeof *to);
            to += FRAMESINK_PHOTO;
        }
    return s->photo;
}

int framesink_write_feat(struct framesink *s, const struct framesink_frame *f,
                                struct error *err)
{
    const bool half = s->opt.record == FRAMESINK_FEAT_F16;
    const size_t C = (size_t)f->channels, N = f->width * f->height;
    const bool packed = s->opt.covered && f->alpha;
    const enum dtype type = half ? DTYPE_F16 : DTYPE_F32;
    const void *feat = half ? (const void *)framesink_half_features(s, f, N * C)
                            : f->color;
    const struct covered *c = &s->covered;
    const float *photo = f->photo && packed ? framesink_packed_photo(s, f)
                                            : f->photo;
    struct array a[7];
    int n = 1;

    if (!feat || !photo != !f->photo
        || (packed
            && covered_find(&s->covered, feat, f->alpha, N,
                            C * dtype_size(type))))
        return error_set(err, EX_OSERR, "out of memory");
    a[0] = packed ? array_make("feat", type, NULL, 2, c->pixels, C, 0, 0)
                  : array_make("feat", type, feat, 3, f->height, f->width, C,
                               0);
    if (f->alpha)
        a[n++] = array_make("alpha", DTYPE_F32, f->alpha, 2, f->height,
                            f->width, 0, 0);
    if (f->depth)
        a[n++] = array_make("depth", DTYPE_F32, f->depth, 2, f->height,
                            f->width, 0, 0);
    if (photo)
        a[n++] = packed ? array_make("photo", DTYPE_F32, photo, 2, c->pixels,
                                     FRAMESINK_PHOTO, 0, 0)
                        : array_make("photo", DTYPE_F32, photo, 3, f->height,
                                     f->width, FRAMESINK_PHOTO, 0);
    if (f->place) {
        a[n++] = array_make("place", DTYPE_F32, f->place, 3, f->height,
                            f->width, 3, 0);
        a[n++] = array_make("map", DTYPE_F32, f->map, 1, 6, 0, 0, 0);
    }
    if (f->turned)
        a[n++] = array_make("turn", DTYPE_F32, f->turn, 1,
                            RELATIVE_POSE_SIZE, 0, 0, 0);
    return stream_write_parts(s->stream, RECORD_FEAT, f->frame, f->time, a, n,
                              packed ? c->run : NULL, packed ? c->runs : 0,
                              err);
}
