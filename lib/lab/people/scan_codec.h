/* What low-rate video does to a picture. */
#ifndef SPID_LAB_PEOPLE_SCAN_CODEC_H
#define SPID_LAB_PEOPLE_SCAN_CODEC_H

#include <stdint.h>

/* The picture rgb (n,n,3) after coding like H.264's at quantiser q (18 fine to
 * 40 coarse) and back: transform blocks with a dead zone, chroma at half the
 * resolution, block borders smoothed.  scratch (n,n,3). */
void codec_damage(uint8_t *rgb, float *scratch, int n, int q);

#endif
