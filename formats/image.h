/* Pictures from files: PNG, JPEG, WebP, HEIF, AVIF and anything OpenImageIO
 * reads, as 8-bit RGB the way a person sees it (formats/door.h). */
#ifndef SPID_FORMATS_IMAGE_H
#define SPID_FORMATS_IMAGE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"

/* Largest picture that is read, in pixels, and the longest side. */
#define IMAGE_MAX_PIXELS ((size_t)200 << 20)
#define IMAGE_MAX_SIDE 32768
/* Largest file of one that is read from a pipe: four channels of 16 bits. */
#define IMAGE_MAX_BYTES (8 * IMAGE_MAX_PIXELS)

struct image {
    size_t width, height;
    uint8_t *rgb;           /* [height, width, 3], sRGB */
    uint8_t *alpha;         /* [height, width] straight; NULL: opaque */
    bool damaged;           /* a JPEG that is cut short or damaged, with grey
                             * where the pixels are missing */
};

/* Read a picture from a file, a pipe or standard input ("-").  Grey is spread
 * over the channels, 16 bits are rounded to 8, floating point (taken as linear
 * unless the file says otherwise) is encoded as sRGB, alpha is kept apart and
 * made straight; what the file says of orientation, shape of pixels and colours
 * is followed.  Refused with EX_DATAERR: CMYK without a profile, more pixels
 * than the limits above (checked before anything is allocated), zero size,
 * damaged files.  EX_NOINPUT: cannot be opened.  The caller releases *im; on
 * failure it is zeroed. */
int image_read(struct image *im, const char *path, struct error *err);

/* Free what it holds; zeroed then. */
void image_release(struct image *im);

/* Write an 8-bit PNG, marked (formats/mark.h), beside its final name and rename
 * it.  channels: 1 grey, 2 grey + alpha, 3 RGB, 4 RGBA (straight). */
int image_write_png(const char *path, const uint8_t *pixel, size_t width,
                    size_t height, int channels, struct error *err);

/* Write pixel [height,width,channels] f32 with the given channel names as
 * OpenEXR (ZIP compressed; attribute spid:encoding = sRGB; marked) to path as it
 * is: the caller renames. */
int exr_write(const char *path, const float *pixel, size_t width,
              size_t height, int channels, const char *const *names,
              struct error *err);

#endif
