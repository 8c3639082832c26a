/* PPM, PGM and PAM: a stream of pictures, one after the other. */
#ifndef SPID_FORMATS_PNM_H
#define SPID_FORMATS_PNM_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "lib/base/error.h"

/* Read the next picture of fp (P5, P6 or P7; grey is spread, 16 bits are
 * rounded, other maximal values scaled) into *rgb [height,width,3], which is
 * grown as needed (*room bytes); alpha is skipped; at most `max` pixels.  1;
 * 0 at the end of the file; -1: not such a picture, too large, or cut short.
 */
int pnm_read(FILE *fp, uint8_t **rgb, size_t *room, size_t *width,
             size_t *height, size_t max, struct error *err);

/* Write pixel [H,W,channels] (3 RGB, 4 RGB and alpha) as one PAM picture.
 * Not 0 when fp does not take it. */
int pnm_write(FILE *fp, const uint8_t *pixel, size_t W, size_t H,
              size_t channels);

#endif
