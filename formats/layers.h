/* A picture of a person as two layers: the person, with a soft matte, and the
 * background that goes on behind.  rgb = person + (1 - matte) back with the
 * person's colours multiplied by the matte (Porter and Duff 1984). */
#ifndef SPID_FORMATS_LAYERS_H
#define SPID_FORMATS_LAYERS_H

#include <stdbool.h>
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
 *               person, and reaches as far as colours of the person do:
 *               beside it, what is a mixture of the settled background
 *               further out and of the person gains the share that this is;
 *               0 at small pieces apart from the person
 *   back [n,n,3] out: as layers_fill, changed where need be so that
 *               rgb = person + (1 - matte) back holds with a person whose
 *               colours are in range
 *   rgb [n,n,3] in; out: changed outside the picture only, to the background
 *   inside [n,n] as above, but not NULL */
int layers_split(uint8_t *matte, uint8_t *back, uint8_t *rgb,
                 const uint8_t *inside, size_t n, struct error *err);

/* Layers found at s by s pixels for the same picture at n by n, n > s.  Small
 * (_s): matte, back and rgb as layers_split or layers_fill left them.
 *   rgb [n,n,3]   in; out: outside of the picture what rgb_s has there
 *   matte [n,n]   out: matte_s, and along its border and beside it what the
 *                 finer colours say; or in, when it is known: then only changed
 *                 outside
 *   back [n,n,3]  out: rgb where matte is 0, back_s elsewhere; such that
 *                 rgb = person + (1 - matte) back
 *   inside [n,n]  0 where the square lies outside the picture */
int layers_enlarge(uint8_t *matte, uint8_t *back, uint8_t *rgb, size_t n,
                   const uint8_t *matte_s, const uint8_t *back_s,
                   const uint8_t *rgb_s, size_t s, const uint8_t *inside,
                   bool known, struct error *err);

#endif
