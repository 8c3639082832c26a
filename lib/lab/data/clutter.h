/* Rooms that nobody stands in: shapes that hide one another ("dead leaves",
 * Lee, Mumford and Huang 2001), as sharp and as full as rooms in photographs
 * are. */
#ifndef SPID_LAB_DATA_CLUTTER_H
#define SPID_LAB_DATA_CLUTTER_H

#include <stddef.h>

#include "lib/base/random.h"

/* A picture that shapes are cut from: (n,n,step) numbers in [0,1], of which
 * the first three are colours. */
struct clutter_patch {
    const float *rgb;
    size_t n, step;
};

/* wall (n,n,3), 0 to 1: up to 60 shapes, upright or turned, flat or sloping,
 * striped, rippled, or patches of the picture (rgb NULL: none).  `own`, three
 * numbers, is a colour that some of them have, which makes them hard to tell
 * from whoever wears it.  From the order of r's numbers alone. */
void clutter_paint(float *wall, size_t n, const struct clutter_patch *patch,
                   const float own[3], struct random *r);

/* Mean over a square of 2 radius + 1 pixels, cut at the border, of wall
 * (n,n,3); row holds 3 n numbers. */
void clutter_blur(float *wall, float *row, size_t n, size_t radius);

#endif
