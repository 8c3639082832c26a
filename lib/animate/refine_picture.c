/* From refined features to what leaves (refine_picture.h). */
#include "lib/animate/refine_picture.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/splat/relight.h"

_Static_assert(sizeof(struct splat_place_view) == FEAT_MAP * sizeof(float),
               "a map is a view of places");

/* Room for a picture as large as the features. */
static int refine_picture_make_room(struct refine_picture *p,
                                    const struct feat *in,
                                    struct error *err)
{
    const size_t n = in->height * in->width;
    const size_t places = refine_places(in->height) * refine_places(in->width);

    if (n == p->room && places == p->places)
        return 0;
    free(p->rgb);
    p->rgb = malloc((4 * n + TEXTURE_FIELD * places) * sizeof *p->rgb);
    p->room = p->rgb ? n : 0;
    p->places = places;
    if (!p->rgb)
        return error_set(err, EX_OSERR, "no memory for %zu x %zu pixels",
                         in->width, in->height);
    p->alpha = p->rgb + 3 * n;
    p->said = p->alpha + n;
    return 0;
}

int refine_picture_refine(struct refine_picture *p, struct refine *r,
                          const struct feat *in, struct error *err)
{
    if (refine_picture_make_room(p, in, err) ||
        refine_frame(p->rgb, r, in, err))
        return -1;
    p->shown = r->shown;
    p->field = refine_field(p->said, r, in);
    return 0;
}

/* What is refined, enlarged, with the photograph at the larger size. */
static int refine_picture_enlarge(struct refine_picture *p,
                                  const struct feat *in,
                                  struct error *err)
{
    struct zoom *z = &p->zoom;
    const bool photo = in->place && p->texture;
    struct splat_place_view view = {0};

    if (in->height != in->width || in->height > p->size || !in->alpha)
        return error_set(err, EX_DATAERR, "FEAT of %zu x %zu pixels%s "
                         "(expected a square of at most --size=%zu, with "
                         "alpha)", in->width, in->height,
                         in->alpha ? "" : " without alpha", p->size);
    if (z->from != in->width) {
        zoom_release(z);
        if (zoom_init(z, in->width, p->size, err))
            return -1;
    }
    texture_clamp_to_alpha(p->rgb, 3, in->alpha, in->height * in->width);
    if (photo)
        memcpy(&view, in->map, sizeof view);
    zoom_picture(z, p->rgb, in->alpha, photo ? in->place : NULL, &view,
                 p->texture, &p->field);
    if (in->gain)
        relight_apply(z->color, 3, z->alpha, in->gain, in->tint, in->width,
                      z->to, z->to);
    p->height = p->width = z->to;
    p->color = z->color;
    p->coverage = z->alpha;
    return 0;
}

int refine_picture_finish(struct refine_picture *p,
                          const struct feat *in, struct error *err)
{
    const size_t n = in->height * in->width;

    if (p->size && p->size != in->width)
        return refine_picture_enlarge(p, in, err);
    if (in->alpha)
        memcpy(p->alpha, in->alpha, n * sizeof *p->alpha);
    if (in->alpha && p->shown)
        texture_compose(p->rgb, p->alpha, p->shown, &p->field, in->height,
                        in->width);
    else if (in->alpha)
        texture_clamp_to_alpha(p->rgb, 3, p->alpha, n);
    if (in->gain)
        relight_apply(p->rgb, 3, in->alpha ? p->alpha : NULL, in->gain,
                      in->tint, in->width, in->height, in->width);
    p->height = in->height;
    p->width = in->width;
    p->color = p->rgb;
    p->coverage = in->alpha ? p->alpha : NULL;
    return 0;
}

int refine_picture_compare(double *max, double *db,
                           const struct refine_picture *p,
                           const struct refine *r,
                           const struct feat *in, struct error *err)
{
    const size_t n = in->height * in->width * 3;
    struct refine full = {0};
    float *want = malloc(n * sizeof *want);
    double square = 0;
    int rc = want ? 0 : error_set(err, EX_OSERR, "no memory to compare");

    if (rc == 0)
        rc = refine_open(&full, r->model, NN_F32, false, err);
    if (rc == 0)
        rc = refine_frame(want, &full, in, err);
    *max = 0;
    for (size_t i = 0; rc == 0 && i < n; i++) {
        double a = fmin(1, fmax(0, want[i])), b = fmin(1, fmax(0, p->rgb[i]));

        *max = fmax(*max, fabs(a - b));
        square += (a - b) * (a - b);
    }
    square /= (double)n;
    *db = square > 0 ? -10 * log10(square) : INFINITY;
    refine_release(&full);
    free(want);
    return rc;
}

void refine_picture_release(struct refine_picture *p)
{
    zoom_release(&p->zoom);
    free(p->rgb);
    memset(p, 0, sizeof *p);
}
