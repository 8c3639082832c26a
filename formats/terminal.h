/* Pictures in a terminal: two pixels in every character, in 24-bit colour. */
#ifndef SPID_FORMATS_TERMINAL_H
#define SPID_FORMATS_TERMINAL_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

/* Columns and lines of the terminal behind fp, or of COLUMNS and LINES in the
 * environment, or 80 by 24. */
void terminal_size(FILE *fp, int *columns, int *lines);
/* Draw rgb [height,width,3] over what was drawn before, as large as fits into
 * columns by lines; a pixel is a box average.  0, or -1 and errno. */
int terminal_draw(FILE *fp, const uint8_t *rgb, size_t width, size_t height,
                  int columns, int lines);
/* Leave the terminal as it was, below the picture. */
int terminal_end(FILE *fp);

#endif
