/* Enlarging a drawn picture and looking the photograph up in it (zoom.h). */
#include "lib/photo/zoom.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/resample.h"
#include "lib/photo/place.h"

int zoom_init(struct zoom *z, size_t from, size_t to, bool place,
              struct error *err)
{
    const size_t n = to * to;

    memset(z, 0, sizeof *z);
    z->from = from;
    z->to = to;
    z->plan = resize_plan(RESIZE_BILINEAR, from, from, to, to, 0, 0);
    z->scratch = z->plan ? malloc(resize_scratch(z->plan, 3) * sizeof(float))
                         : NULL;
    z->color = malloc(3 * n * sizeof *z->color);
    z->alpha = malloc(n * sizeof *z->alpha);
    z->place = place ? malloc(PLACE_CHANNELS * n * sizeof *z->place) : NULL;
    if (z->scratch && z->color && z->alpha && (z->place || !place))
        return 0;
    zoom_release(z);
    return error_set(err, EX_OSERR, "no memory for a picture of %zu x %zu "
                     "pixels", to, to);
}

void zoom_release(struct zoom *z)
{
    resize_release(z->plan);
    free(z->scratch);
    free(z->color);
    free(z->alpha);
    free(z->place);
    memset(z, 0, sizeof *z);
}

void zoom_picture(struct zoom *z, const float *color, const float *alpha,
                  const float *place, const struct splat_place_view *v,
                  const struct texture *t, const struct texture_field *field)
{
    const float times = (float)z->to / (float)z->from;

    resize_forward(z->plan, z->color, color, 1, 3, z->scratch);
    resize_forward(z->plan, z->alpha, alpha, 1, 1, z->scratch);
    if (!place)
        return;
    resize_forward(z->plan, z->place, place, 1, PLACE_CHANNELS, z->scratch);
    if (field->at)
        texture_apply_field(z->color, z->alpha, t, v, z->place, z->to, field,
                            times * TEXTURE_FIELD_STEP);
    else
        texture_apply(z->color, 3, z->alpha, t, v, z->place, z->to);
}
