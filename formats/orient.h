/* Pictures the way they were held: Exif's and TIFF's orientations, 1 to 8. */
#ifndef SPID_FORMATS_ORIENT_H
#define SPID_FORMATS_ORIENT_H

#include <stdbool.h>
#include <stddef.h>

/* How the stored picture must be turned to be upright. */
enum orientation {
    ORIENT_UPRIGHT = 1,
    ORIENT_MIRRORED,            /* left and right are changed */
    ORIENT_HALF_TURN,
    ORIENT_FLIPPED,             /* upside down */
    ORIENT_TRANSPOSED,          /* rows are columns, from here on */
    ORIENT_TURN_RIGHT,          /* a quarter turn to the right */
    ORIENT_TRANSVERSED,         /* about the other diagonal */
    ORIENT_TURN_LEFT
};

/* An orientation as files say it; upright if it is none. */
static inline enum orientation orient_read(unsigned number)
{
    return number >= ORIENT_UPRIGHT && number <= ORIENT_TURN_LEFT
         ? (enum orientation)number : ORIENT_UPRIGHT;
}

/* Whether the upright picture is as wide as the stored one is high. */
static inline bool orient_swaps(enum orientation o)
{
    return o >= ORIENT_TRANSPOSED;
}

/* Number of the pixel, in the upright picture, that (x,y) of the stored one
 * becomes, which is W by H. */
static inline size_t orient_pixel(size_t x, size_t y, size_t W, size_t H,
                                  enum orientation o)
{
    switch (o) {
    case ORIENT_MIRRORED: return y * W + (W - 1 - x);
    case ORIENT_HALF_TURN: return (H - 1 - y) * W + (W - 1 - x);
    case ORIENT_FLIPPED: return (H - 1 - y) * W + x;
    case ORIENT_TRANSPOSED: return x * H + y;
    case ORIENT_TURN_RIGHT: return x * H + (H - 1 - y);
    case ORIENT_TRANSVERSED: return (W - 1 - x) * H + (H - 1 - y);
    case ORIENT_TURN_LEFT: return (W - 1 - x) * H + y;
    default: return y * W + x;
    }
}

#endif
