/* Parts of a matte that are not connected to the person: background that the
 * matte's network takes for hair.  Left in, a piece of a door would stand
 * before the wall when the head moves. */
#ifndef SPID_FORMATS_LAYERS_ISLANDS_H
#define SPID_FORMATS_LAYERS_ISLANDS_H

#include <stddef.h>
#include <stdint.h>

/* matte [n,n], in place: 0 where a piece of less than a fiftieth of the picture
 * lies farther from the larger ones than flying hair and ears do, and far from
 * all that is left.  May throw what OpenCV throws. */
void layers_islands(uint8_t *matte, size_t n);

#endif
