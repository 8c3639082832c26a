/* PNG by libpng, to an open file: one picture after the other. */
#ifndef SPID_FORMATS_PNG_H
#define SPID_FORMATS_PNG_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "formats/image.h"
#include "lib/base/error.h"

/* Write pixel [height,width,channels] (1 grey, 2 grey + alpha, 3 RGB, 4 RGBA
 * straight), tagged sRGB.  EX_IOERR with libpng's text. */
int png_write(FILE *fp, const uint8_t *pixel, size_t width, size_t height,
              int channels, struct error *err);

/* The same of what the toolkit drew: with its mark (formats/mark.h). */
int png_write_marked(FILE *fp, const uint8_t *pixel, size_t width,
                     size_t height, int channels, struct error *err);

/* Whether the PNG that fp begins with is an animation (APNG); fp is at its
 * start again. */
bool png_is_animated(FILE *fp);

/* Read the next PNG of fp as image_read promises; at most `max` pixels. */
int png_read_next(struct image *im, FILE *fp, size_t max, struct error *err);

#endif
