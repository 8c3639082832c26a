/* What lens and sensor do to a plane of a picture. */
#ifndef SPID_LAB_PEOPLE_LENS_H
#define SPID_LAB_PEOPLE_LENS_H

#include <stdint.h>

/* v of channel k with the sensor's noise; h: the pixel's random number. */
float lens_grain(float v, int k, uint64_t h, float noise);

/* Blur img (n,n) by a Gaussian of sigma pixels, cut off at 16, in place; tmp
 * is as large. */
void lens_soften(float *img, float *tmp, int n, float sigma);

/* Means of img (n,n) over 2 r + 1 pixels, twice along each axis, in place; ends
 * are repeated.  n is a multiple of 16, LENS_BOX at most; tmp is as large. */
#define LENS_BOX 512
void lens_box(float *img, float *tmp, int n, int r);

/* Mean of img (n,n) along a straight way of (dx,dy) pixels, in place: a
 * hand-held camera or a moving head. */
void lens_smear(float *img, float *tmp, int n, float dx, float dy);

/* A coarser sensor: img (n,n) becomes means over cells of 1/low pixels, read
 * back bilinear; tmp is as large. */
void lens_coarsen(float *img, float *tmp, int n, float low);

#endif
