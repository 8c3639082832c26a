/* JPEG by libjpeg: the photographs that most people have, without what
 * OpenImageIO brings along. */
#ifndef SPID_FORMATS_JPEG_H
#define SPID_FORMATS_JPEG_H

#include <stdio.h>

#include "formats/image.h"

/* *im from an open file, as image_read promises; name for messages.  Where
 * data are missing or damaged pixels are grey and im->damaged is set; a file
 * that holds none is refused (EX_DATAERR), and *im zeroed. */
int jpeg_read(struct image *im, FILE *fp, const char *name,
              struct error *err);

#endif
