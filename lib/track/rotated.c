/* A quarter turn at a time, the matte with the colours. */
#include "lib/track/rotated.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/orient.h"

/* Pixels of `step` bytes; NULL when memory is short, which *err says. */
static uint8_t *rotated_plane(const uint8_t *from, size_t W, size_t H,
                              size_t step, int quarters, struct error *err)
{
    static const enum orientation way[4] = {
        ORIENT_UPRIGHT, ORIENT_TURN_RIGHT, ORIENT_HALF_TURN, ORIENT_TURN_LEFT
    };
    uint8_t *to = malloc(W * H * step + 1);

    if (!to)
        error_set(err, EX_OSERR, "no memory to turn a picture of %zu x %zu "
                  "pixels", W, H);
    for (size_t y = 0; to && y < H; y++)
        for (size_t x = 0; x < W; x++, from += step)
            memcpy(to + step * orient_pixel(x, y, W, H, way[quarters]), from,
                   step);
    return to;
}

int rotated_copy(struct image *out, const struct image *im, int quarters,
                 struct error *err)
{
    const size_t W = im->width, H = im->height;

    *out = *im;
    out->width = quarters % 2 ? H : W;
    out->height = quarters % 2 ? W : H;
    out->rgb = rotated_plane(im->rgb, W, H, 3, quarters, err);
    out->alpha = im->alpha && out->rgb
                     ? rotated_plane(im->alpha, W, H, 1, quarters, err) : NULL;
    if (out->rgb && (out->alpha || !im->alpha))
        return 0;
    image_release(out);
    return -1;
}

/* The quarter turns, 1 to 3, in which a face that track_start finds is surest; 0
 * where none shows one; -1. */
static int rotated_best(struct track *t, const struct frame *f,
                        const struct track_effort *effort, struct error *err)
{
    float confidence = 0;
    int best = 0;

    for (int k = 1; k < 4; k++) {
        struct track_result r;
        struct frame rotated = *f;
        uint8_t *rgb = rotated_plane(f->rgb, f->width, f->height, 3, k, err);

        if (!rgb)
            return -1;
        rotated.rgb = rgb;
        rotated.width = k % 2 ? f->height : f->width;
        rotated.height = k % 2 ? f->width : f->height;
        const int found = track_start(t, &r, &rotated, effort, err);

        free(rgb);
        if (found < 0)
            return -1;
        if (found && r.confidence > confidence) {
            confidence = r.confidence;
            best = k;
        }
    }
    return best;
}

/* Two witnesses: the detector, which is fast, knows faces that stand upright and
 * look ahead; E_m those from any side, but hardly which way is up.  So the
 * picture is turned to where the detector is certain of a face if it is of none
 * as the picture is, and else where E_m is surest, of large faces, if neither
 * sees one as the picture is. */
int rotated_start(struct track *t, struct track_result *r, int *quarters,
                  const struct frame *f, struct error *err)
{
    const struct track_effort certain = {.certain = true};
    const struct track_effort quick = {.levels = TRACK_QUICK};
    const bool turns = t->tta.net->confidence.ps && !t->opt.has_crop;
    int found = 0;

    *quarters = 0;
    if (turns) {
        found = track_start(t, r, f, &certain, err);
        if (found == 0)
            *quarters = rotated_best(t, f, &certain, err);
    }
    if (found == 0 && *quarters == 0) {
        found = track_start(t, r, f, NULL, err);
        if (found == 0 && turns)
            *quarters = rotated_best(t, f, &quick, err);
    }
    return *quarters < 0 ? -1 : found;
}
