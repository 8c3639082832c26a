/* What the networks see of a picture: the crop (track.h). */
#include <math.h>
#include <stdlib.h>
#include <sysexits.h>

#include "lib/track/track.h"

/* The part of the picture about q at half size, until two pixels of it or
 * fewer make one of the crop.  Updates picture, sizes and q. */
static int track_shrink(struct track *t, const uint8_t **rgb, size_t *W,
                        size_t *H, size_t *stride, struct square *q)
{
    while (q->size > 2 * CROP_NET && *W > 1 && *H > 1) {
        double l = floor(q->x - q->size / 2) - 4;
        double u = floor(q->y - q->size / 2) - 4;
        size_t x0 = l > 0 ? (size_t)fmin(l, (double)*W) / 2 * 2 : 0;
        size_t y0 = u > 0 ? (size_t)fmin(u, (double)*H) / 2 * 2 : 0;
        double r = q->x + q->size / 2 + 4, b = q->y + q->size / 2 + 4;
        size_t x1 = r < (double)*W ? (size_t)fmax(r, (double)x0) : *W;
        size_t y1 = b < (double)*H ? (size_t)fmax(b, (double)y0) : *H;
        size_t w = (x1 - x0) / 2, h = (y1 - y0) / 2;
        uint8_t *out;
        if (w == 0 || h == 0)
            return 0;
        /* the first step writes the buffer, the others shrink in place */
        if (3 * w * h > t->half_room) {
            uint8_t *grown = malloc(3 * w * h);
            if (!grown)
                return -1;
            free(t->half);
            t->half = grown;
            t->half_room = 3 * w * h;
        }
        out = t->half;
        crop_halve(out, *rgb + y0 * *stride + 3 * x0, 2 * w, 2 * h, *stride);
        *rgb = out;
        *stride = 3 * w;
        *W = w;
        *H = h;
        q->x = (q->x - (double)x0) / 2;
        q->y = (q->y - (double)y0) / 2;
        q->size /= 2;
    }
    return 0;
}

int track_cut(float *out, struct track *t, const struct frame *f,
              struct square crop, struct error *err)
{
    struct square q = square_out_of(crop, t->window, t->opt.size);
    const uint8_t *rgb = f->rgb;
    size_t W = f->width, H = f->height, stride = 3 * W;

    if (track_shrink(t, &rgb, &W, &H, &stride, &q) != 0)
        return error_set(err, EX_OSERR, "no memory to shrink a frame");
    crop_sample_u8(out, CROP_NET, rgb, W, H, stride, q);
    return 0;
}
