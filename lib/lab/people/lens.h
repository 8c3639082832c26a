/* What the camera makes of the light: background, exposure, tone, colour,
 * blur, noise, coarse sensors and JPEG. */
#ifndef SPID_LAB_PEOPLE_LENS_H
#define SPID_LAB_PEOPLE_LENS_H

#include <stdint.h>

#include "lib/lab/people/persona.h"
#include "lib/lab/people/stage.h"

/* Tables; once, before the first parallel region. */
void lens_init(void);

/* Linear background (n,n,3) of a persona, the same in all its frames. */
void backdrop_paint(float *wall, const struct persona *p, int n);

/* rgb (n,n,3) and mask (n,n) of the stage from light over wall.  frame selects
 * the noise, time moves an occluder; blur_x, blur_y is the motion during the
 * exposure, pixels. */
void lens_expose(struct stage *s, const struct persona *p, const float *wall,
                 uint64_t frame, double time, float blur_x, float blur_y);

/* v of channel k with the sensor's noise; h: the pixel's random number. */
float lens_grain(float v, int k, uint64_t h, float noise);

#define LENS_BLUR_MOST 16       /* the widest blur's, pixels to a side */

/* Blur img (n,n,channels) by a Gaussian of sigma pixels, cut off at `most` of
 * them (no more than LENS_BLUR_MOST), in place; tmp is as large. */
void lens_soften(float *img, float *tmp, int n, int channels, int most,
                 float sigma);

/* Mean of img (n,n,channels) along a straight way of (dx,dy) pixels, in place:
 * a hand-held camera or a moving head; `most` samples at the most. */
void lens_smear(float *img, float *tmp, int n, int channels, int most,
                float dx, float dy);

/* A coarser sensor: img (n,n,channels) becomes means over cells of 1/low
 * pixels, read back bilinear; tmp is as large. */
void lens_coarsen(float *img, float *tmp, int n, int channels, float low);

/* Draw the persona's occluder, if any, over light; takes it out of cover and
 * labels it. */
void occluder_draw(struct stage *s, const struct persona *p, double time);

/* The picture rgb (n,n,3) after compression at quality 1..100 and back:
 * 8x8 cosine blocks, chroma at half the resolution.  scratch (n,n,3). */
void jpeg_damage(uint8_t *rgb, float *scratch, int n, int quality);

#endif
