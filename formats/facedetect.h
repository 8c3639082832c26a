/* The first crop: frontal faces by the Haar cascade of Debian's opencv-data. */
#ifndef SPID_FORMATS_FACEDETECT_H
#define SPID_FORMATS_FACEDETECT_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/crop.h"
#include "lib/base/error.h"
#include "lib/base/mipmap.h"

struct facedetect;

/* Load the cascade: $SPID_CASCADES, then the places distributions use.
 * EX_UNAVAILABLE names what was tried. */
struct facedetect *facedetect_open(struct error *err);
void facedetect_close(struct facedetect *d);     /* NULL is allowed */

/* Which faces are looked for.  Half as large are four times the pixels. */
enum facedetect_size {
    FACEDETECT_LARGEST,         /* from a fifth of the shorter side up, or if
                                 * there is none from a twelfth */
    FACEDETECT_ALL,             /* from a twelfth */
    FACEDETECT_SMALL            /* from a twenty-fourth */
};

/* Upright, frontal faces of the picture, the largest first, at most `max`: face
 * (the detector's boxes, in picture pixels).
 * Returns how many; certain: 0 unless one of them is surely upright. */
size_t facedetect_find(struct facedetect *d, struct square *face, size_t max,
                       enum facedetect_size size, bool certain,
                       struct mipmap *picture);

#endif
