/* The door (door.h), a stored row at a time. */
#include "formats/door.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

int door_check_size(size_t width, size_t height, const char *name,
                    struct error *err)
{
    if (width < 1 || height < 1)
        return error_set(err, EX_DATAERR, "%s: picture of %zu x %zu pixels has "
                         "no content", name, width, height);
    if (width > IMAGE_MAX_SIDE || height > IMAGE_MAX_SIDE ||
        width * height > IMAGE_MAX_PIXELS)
        return error_set(err, EX_DATAERR, "%s: picture of %zu x %zu pixels is "
                         "too large (at most %d a side and %zu in all)",
                         name, width, height, IMAGE_MAX_SIDE,
                         IMAGE_MAX_PIXELS);
    return 0;
}

/* Size of the stored picture with square pixels: the side that is too short is
 * enlarged, so nothing is lost.  As it was where the aspect is none (not
 * positive, or beyond 1 to 100). */
static void door_square_size(size_t *width, size_t *height, double aspect)
{
    if (!(aspect >= 0.01 && aspect <= 100) || fabs(aspect - 1) < 1e-3)
        return;
    if (aspect > 1)
        *width = (size_t)((double)*width * aspect + 0.5);
    else
        *height = (size_t)((double)*height / aspect + 0.5);
}

/* Whether the way that is there serves the next picture, too. */
static bool door_is_same(const struct door *d, const struct image *im,
                         size_t width, size_t height,
                         const struct door_tag *tag)
{
    const struct colour_tag *a = &d->tag.colour, *b = &tag->colour;
    const struct colour_pixels *p = &d->tag.pixels, *q = &tag->pixels;

    return d->to == im && d->width == width && d->height == height &&
           d->tag.orientation == tag->orientation &&
           d->tag.aspect == tag->aspect && d->tag.alpha == tag->alpha &&
           a->icc == b->icc && a->primaries == b->primaries &&
           a->transfer == b->transfer && a->gamma == b->gamma &&
           a->peak == b->peak && p->channels == q->channels &&
           p->extra == q->extra && p->bits == q->bits;
}

/* Room for the stored picture, turned. */
static int door_make_room(struct door *d, const char *name, struct error *err)
{
    const size_t n = d->width * d->height;
    const bool swaps = orient_swaps(d->tag.orientation);
    struct image *im = d->to;

    free(im->rgb);
    free(im->alpha);
    im->width = swaps ? d->height : d->width;
    im->height = swaps ? d->width : d->height;
    im->rgb = malloc(3 * n);
    im->alpha = d->tag.alpha ? malloc(n) : NULL;
    return im->rgb && (im->alpha || !d->tag.alpha)
         ? 0 : error_set(err, EX_OSERR, "%s: out of memory", name);
}

int door_open(struct door *d, struct image *im, size_t width, size_t height,
              const struct door_tag *tag, const char *name, struct error *err)
{
    struct door_tag t = *tag;
    size_t w = width, h = height;

    t.orientation = orient_read((unsigned)tag->orientation);
    door_square_size(&w, &h, t.aspect);
    if (w == width && h == height)
        t.aspect = 1;
    if (!door_is_same(d, im, width, height, &t)) {
        door_release(d);
        if (door_check_size(width, height, name, err) ||
            door_check_size(w, h, name, err))
            return -1;
        d->width = width;
        d->height = height;
        d->tag = t;
        d->colour = colour_open(&t.colour, t.pixels);
        d->row = malloc(3 * width);
        if (t.pixels.channels == 4 && !d->colour)
            return error_set(err, EX_DATAERR, "%s: CMYK picture without a "
                             "profile that says what its inks look like "
                             "(expected grey, RGB, or such a profile)", name);
        if (!d->row)
            return error_set(err, EX_OSERR, "%s: out of memory", name);
    }
    d->opaque = true;
    if (d->to == im && t.aspect == 1 && !t.alpha)
        return 0;
    d->to = im;
    return door_make_room(d, name, err);
}

/* The row's alphas to their places. */
static void door_row_alpha(struct door *d, const void *row, size_t y)
{
    const struct colour_pixels *p = &d->tag.pixels;
    const size_t all = (size_t)(p->channels + p->extra);
    const uint8_t *narrow = row;
    const uint16_t *wide = row;

    for (size_t x = 0; x < d->width; x++) {
        const size_t at = x * all + all - 1;
        const uint8_t a = p->bits == 8 ? narrow[at]
                        : (uint8_t)((wide[at] * 255u + 32767) / 65535);

        d->to->alpha[orient_pixel(x, y, d->width, d->height,
                                  d->tag.orientation)] = a;
        d->opaque &= a == 255;
    }
}

void door_row(struct door *d, const void *row, size_t y)
{
    const bool rotated = d->tag.orientation != ORIENT_UPRIGHT;
    uint8_t *rgb = rotated ? d->row : d->to->rgb + 3 * d->width * y;

    colour_row(d->colour, rgb, row, d->width, d->tag.pixels);
    for (size_t x = 0; rotated && x < d->width; x++)
        memcpy(d->to->rgb + 3 * orient_pixel(x, y, d->width, d->height,
                                             d->tag.orientation),
               rgb + 3 * x, 3);
    if (d->to->alpha)
        door_row_alpha(d, row, y);
}

/* One plane of the image at another size; the old one is freed. */
static int door_resize_plane(uint8_t **plane, int channels, size_t W, size_t H,
                             const struct image *im, struct error *err)
{
    uint8_t *big = malloc((size_t)channels * W * H);

    if (!big)
        return error_set(err, EX_OSERR, "out of memory");
    const int rc = door_resize(big, W, H, *plane, im->width, im->height,
                               channels, err);
    free(*plane);
    *plane = big;
    return rc;
}

int door_close(struct door *d, struct error *err)
{
    struct image *im = d->to;
    size_t W = d->width, H = d->height;
    int rc = 0;

    door_square_size(&W, &H, d->tag.aspect);
    if (im->alpha && d->opaque) {
        free(im->alpha);
        im->alpha = NULL;
    }
    if (W != d->width || H != d->height) {
        if (orient_swaps(d->tag.orientation)) {
            const size_t t = W;

            W = H;
            H = t;
        }
        rc = door_resize_plane(&im->rgb, 3, W, H, im, err);
        if (rc == 0 && im->alpha)
            rc = door_resize_plane(&im->alpha, 1, W, H, im, err);
        im->width = W;
        im->height = H;
    }
    return rc;
}

int door_picture(struct door *d, struct image *im, size_t width,
                 size_t height, const struct door_tag *tag, const void *pixels,
                 size_t stride, const char *name, struct error *err)
{
    const uint8_t *row = pixels;

    if (door_open(d, im, width, height, tag, name, err))
        return -1;
    for (size_t y = 0; y < height; y++, row += stride)
        door_row(d, row, y);
    return door_close(d, err);
}

void door_release(struct door *d)
{
    colour_close(d->colour);
    free(d->row);
    *d = (struct door){0};
}
