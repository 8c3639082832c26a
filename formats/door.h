/* The door: whatever a decoder gives leaves it as pictures a person would see,
 * upright, square-pixelled, unmirrored, in 8 bits of sRGB.  Photographs and
 * videos alike pass here, and nowhere else are pixels turned, stretched or
 * coloured. */
#ifndef SPID_FORMATS_DOOR_H
#define SPID_FORMATS_DOOR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "formats/colour.h"
#include "formats/image.h"
#include "formats/orient.h"
#include "lib/base/error.h"

/* What a file says of its pixels beside them. */
struct door_tag {
    enum orientation orientation;       /* 0: upright */
    double aspect;              /* width of a stored pixel over its height; 0:
                                 * not said, square */
    struct colour_tag colour;
    struct colour_pixels pixels;
    bool alpha;                 /* the last channel; it is straight */
};

/* Zeroed before its first picture. */
struct door {
    size_t width, height;       /* as stored */
    struct door_tag tag;
    struct colour *colour;
    uint8_t *row;               /* of sRGB; where it must be turned */
    struct image *to;
    bool opaque;                /* so far */
};

/* Whether a picture of that size may be read: -1 and EX_DATAERR where it has
 * no pixels or too many. */
int door_check_size(size_t width, size_t height, const char *name,
                    struct error *err);
/* Room for the upright picture in *im, of a size that is checked, and the way
 * to it; tag is copied, its profile stays borrowed.  For the next picture of a
 * clip, into the same *im, what it has is used again.  -1 and *err, of which
 * im is released by its owner. */
int door_open(struct door *d, struct image *im, size_t width, size_t height,
              const struct door_tag *tag, const char *name,
              struct error *err);
/* Stored row y, of all channels. */
void door_row(struct door *d, const void *row, size_t y);
/* All rows have come: pixels are made square, an alpha that hides nothing is
 * dropped.  -1 without memory. */
int door_close(struct door *d, struct error *err);
/* All of that for a picture in memory, `stride` bytes a row. */
int door_picture(struct door *d, struct image *im, size_t width,
                 size_t height, const struct door_tag *tag, const void *pixels,
                 size_t stride, const char *name, struct error *err);
/* What d holds, not the image; zeroed then. */
void door_release(struct door *d);

/* rgb (height,width,channels) of 8 bits, resized to W by H into out. */
int door_resize(uint8_t *out, size_t W, size_t H, const uint8_t *rgb,
                size_t width, size_t height, int channels, struct error *err);

#endif
