/* A quarter turn at a time, the matte with the colours. */
#include "lib/track/turned.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

/* Pixels of `step` bytes. */
static uint8_t *turned_plane(const uint8_t *from, size_t W, size_t H,
                             size_t step, int quarters)
{
    uint8_t *to = malloc(W * H * step + 1), *p = to;
    const size_t w = quarters % 2 ? H : W, h = quarters % 2 ? W : H;

    for (size_t y = 0; to && y < h; y++)
        for (size_t x = 0; x < w; x++, p += step) {
            size_t u = quarters == 0 ? x : quarters == 1 ? y
                     : quarters == 2 ? W - 1 - x : W - 1 - y;
            size_t v = quarters == 0 ? y : quarters == 1 ? H - 1 - x
                     : quarters == 2 ? H - 1 - y : x;

            memcpy(p, from + (v * W + u) * step, step);
        }
    return to;
}

int turned_copy(struct image *out, const struct image *im, int quarters,
                struct error *err)
{
    const size_t W = im->width, H = im->height;

    *out = *im;
    out->width = quarters % 2 ? H : W;
    out->height = quarters % 2 ? W : H;
    out->rgb = turned_plane(im->rgb, W, H, 3, quarters);
    out->alpha = im->alpha ? turned_plane(im->alpha, W, H, 1, quarters)
                           : NULL;
    if (out->rgb && (out->alpha || !im->alpha))
        return 0;
    image_release(out);
    return error_set(err, EX_OSERR, "no memory to turn a picture of %zu x "
                     "%zu pixels", W, H);
}

/* track_start in the picture turned by quarters. */
static int turned_look(struct track *t, struct track_result *r,
                       const struct image *im, int quarters, double time,
                       struct error *err)
{
    struct image turned;

    if (turned_copy(&turned, im, quarters, err))
        return -1;
    const int found = track_start(t, r, turned.rgb, turned.width,
                                  turned.height, time, err);
    image_release(&turned);
    return found;
}

/* Two witnesses: the detector knows faces that stand upright and look ahead, E_m
 * those from any side, but hardly which way is up.  So a picture is turned to
 * where the detector sees a face if it sees none as the picture is, and else
 * where E_m is surest if it sees none either as the picture is. */
int turned_start(struct track *t, struct track_result *r, int *quarters,
                 const struct image *im, double time, struct error *err)
{
    const bool quick = t->opt.quick;
    int found = track_start(t, r, im->rgb, im->width, im->height, time, err);
    double best = 0;

    *quarters = 0;
    if (found < 0 || (found && r->detected) || !t->tta.net->sure.ps ||
        t->opt.has_crop)
        return found;
    t->opt.quick = true;        /* of lying faces, large ones alone */
    for (int k = 1; k < 4; k++) {
        struct track_result turned;
        const int seen = turned_look(t, &turned, im, k, time, err);

        if (seen < 0)
            return -1;
        const double much = !seen ? 0 : turned.detected + (double)turned.sure;

        if (much > best && (turned.detected || !found)) {
            best = much;
            *quarters = k;
        }
    }
    t->opt.quick = quick;
    return found == 0 || *quarters
               ? 0 : track_start(t, r, im->rgb, im->width, im->height, time,
                                 err);
}
