/* Pictures larger than what is drawn: networks draw heads at the size they
 * were trained at, the photograph has more pixels.  Colours, coverage and
 * blended places are enlarged bilinearly, for they are smooth, and the
 * photograph is looked up at the larger picture's own pixels. */
#ifndef SPID_PHOTO_ZOOM_H
#define SPID_PHOTO_ZOOM_H

#include <stddef.h>

#include "lib/base/error.h"
#include "lib/nn/rescale.h"
#include "lib/photo/texture.h"

/* From pictures of `from` by `from` pixels to `to` by `to`, to > from; to 0:
 * none is made. */
struct zoom {
    size_t from, to;
    struct nn_plan plan;
    struct rescale three, one, places;  /* channels */
    float *color, *alpha;       /* (to,to,3) premultiplied, (to,to): the
                                 * larger picture */
    float *place;               /* (to,to,4) */
};

/* -1: EX_OSERR. */
int zoom_init(struct zoom *z, size_t from, size_t to, struct error *err);
/* Free what it holds; zeroed then. */
void zoom_release(struct zoom *z);

/* z->color and z->alpha from color (from,from,3) and alpha (from,from); with
 * place (from,from,4, or NULL) and its view v the photograph t over them, and
 * what a refiner says of it (field->at NULL: nothing). */
void zoom_picture(struct zoom *z, const float *color, const float *alpha,
                  const float *place, const struct splat_place_view *v,
                  const struct texture *t, const struct texture_field *field);

#endif
