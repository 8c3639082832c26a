/* Lines, marks and words on an 8-bit RGB picture [H,W,3], for overlays and
 * sheets.  Everything is clipped; coordinates are pixels, centres at + 0.5. */
#ifndef SPID_FORMATS_DRAW_H
#define SPID_FORMATS_DRAW_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/crop.h"

struct canvas {
    uint8_t *rgb;           /* [height,width,3] */
    size_t width, height;
};

struct pen {
    uint8_t color[3];
    double width;           /* pixels */
    double alpha;           /* 0..1 over what is there */
};

/* Antialiased segments, xy [n,2,2]: n pairs of end points.  Segments with a
 * coordinate that is not finite are left out. */
void draw_segments(struct canvas *c, const float *xy, size_t n,
                   struct pen pen);
/* The outline of q, whose sides lie along the picture's. */
void draw_square(struct canvas *c, struct square q, struct pen pen);
/* Filled dots of the given radius at xy [n,2]. */
void draw_dots(struct canvas *c, const float *xy, size_t n, double radius,
               struct pen pen);
/* Words with their baseline's left end at x, y; height in pixels.  A dark rim
 * keeps them readable on any ground. */
void draw_text(struct canvas *c, const char *text, double x, double y,
               double height, struct pen pen);

#endif
