/* Enlarging a drawn picture and looking the photograph up in it (zoom.h). */
#include "lib/photo/zoom.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/photo/place.h"

int zoom_init(struct zoom *z, size_t from, size_t to, struct error *err)
{
    const size_t n = to * to;

    memset(z, 0, sizeof *z);
    z->from = from;
    z->to = to;
    nn_plan_init(&z->plan, (struct nn_options){NN_INFER, NN_F32});
    rescale_plan(&z->three, &z->plan, RESCALE_BILINEAR, 1, from, from, to, to,
                 3);
    rescale_plan(&z->one, &z->plan, RESCALE_BILINEAR, 1, from, from, to, to, 1);
    rescale_plan(&z->places, &z->plan, RESCALE_BILINEAR, 1, from, from, to, to,
                 SPLAT_PLACE_CHANNELS);
    z->color = malloc(3 * n * sizeof *z->color);
    z->alpha = malloc(n * sizeof *z->alpha);
    z->place = malloc(SPLAT_PLACE_CHANNELS * n * sizeof *z->place);
    if (z->color && z->alpha && z->place && !nn_plan_finish(&z->plan, NULL))
        return 0;
    zoom_release(z);
    return error_set(err, EX_OSERR, "no memory for a picture of %zu x %zu "
                     "pixels", to, to);
}

void zoom_release(struct zoom *z)
{
    nn_plan_release(&z->plan);
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

    rescale_forward(z->color, color, &z->three);
    rescale_forward(z->alpha, alpha, &z->one);
    if (!place)
        return;
    rescale_forward(z->place, place, &z->places);
    texture_apply(z->color, z->alpha, t, v, z->place, z->to,
                  field->at ? field : NULL, times * TEXTURE_FIELD_STEP);
}
