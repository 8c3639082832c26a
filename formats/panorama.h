/* Environment maps: equirectangular pictures of light in any format that
 * OpenImageIO reads (Radiance .hdr, OpenEXR), as linear floats. */
#ifndef SPID_FORMATS_PANORAMA_H
#define SPID_FORMATS_PANORAMA_H

#include <stddef.h>

#include "lib/base/error.h"

#define PANORAMA_MAX_SIDE 16384

struct panorama {
    size_t width, height;   /* width = 2 height */
    float *rgb;             /* [height, width, 3] linear; first row: zenith */
};

/* Read a panorama.  Refused with EX_DATAERR: sides that are not 2 to 1 or not
 * 128 to PANORAMA_MAX_SIDE pixels wide, fewer than three channels, cut files, a
 * pixel that is negative, not finite (its place is named) or a picture that
 * is black all over.  EX_NOINPUT: cannot be opened.  The caller releases *p;
 * on failure it is zeroed. */
int panorama_read(struct panorama *p, const char *path, struct error *err);

/* Free what it holds. */
void panorama_release(struct panorama *p);

#endif
