/* A picture of a person as two layers: the person, with a soft matte, and the
 * background that goes on behind.  rgb = person + (1 - matte) back with the
 * person's colours multiplied by the matte (Porter and Duff 1984). */
#ifndef SPID_FORMATS_LAYERS_H
#define SPID_FORMATS_LAYERS_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"

/* back [n,n,3] = rgb where matte [n,n] is 0, and where it is not, what the
 * surroundings say: filled in small (OpenCV's inpainting, Telea 2004) from
 * beyond the matte's rim, then brought to what is seen at its edge, so that
 * there is no seam.
 *   inside [n,n]  0 where the square lies outside the picture, or NULL: the
 *                 border's colours go on there, blurred */
int layers_fill(uint8_t *back, const uint8_t *rgb, const uint8_t *matte,
                const uint8_t *inside, size_t n, struct error *err);

/* The matte's border made what the colours say, and the background.
 *   matte [n,n] in: about the person's outline; out: soft along it, so that
 *               rgb between the colours to both sides is that much of the
 *               person, and reaches as far as colours of the person do
 *   back [n,n,3] out: as layers_fill, changed where need be so that
 *               rgb = person + (1 - matte) back holds with a person whose
 *               colours are in range
 *   rgb [n,n,3] in; out: changed outside the picture only, to the background
 *   inside [n,n] as above, but not NULL */
int layers_split(uint8_t *matte, uint8_t *back, uint8_t *rgb,
                 const uint8_t *inside, size_t n, struct error *err);

#endif
