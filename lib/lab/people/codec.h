/* What lossy codecs do to a picture. */
#ifndef SPID_LAB_PEOPLE_CODEC_H
#define SPID_LAB_PEOPLE_CODEC_H

#include <stdint.h>

/* The picture rgb (n,n,3) after compression at quality 1..100 and back:
 * 8x8 cosine blocks, chroma at half the resolution.  scratch (n,n,3). */
void jpeg_damage(uint8_t *rgb, float *scratch, int n, int quality);

/* The same after coding like H.264's at quantiser q (18 fine to 40 coarse):
 * transform blocks with a dead zone, block borders smoothed. */
void codec_damage(uint8_t *rgb, float *scratch, int n, int q);

#endif
