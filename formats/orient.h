/* Pictures the way they were held: Exif's and TIFF's orientations, 1 to 8. */
#ifndef SPID_FORMATS_ORIENT_H
#define SPID_FORMATS_ORIENT_H

#include <stddef.h>

/* Number of the pixel, in the upright picture, that (x,y) of the stored one
 * becomes; the stored one is W by H, from 5 on the upright one H by W. */
static inline size_t orient_pixel(size_t x, size_t y, size_t W, size_t H,
                                  int orientation)
{
    switch (orientation) {
    case 2: return y * W + (W - 1 - x);
    case 3: return (H - 1 - y) * W + (W - 1 - x);
    case 4: return (H - 1 - y) * W + x;
    case 5: return x * H + y;
    case 6: return x * H + (H - 1 - y);
    case 7: return (W - 1 - x) * H + (H - 1 - y);
    case 8: return (W - 1 - x) * H + y;
    default: return y * W + x;
    }
}

#endif
