/* Small grey pictures of face crops, by which scenes and people are told
 * apart. */
#ifndef SPID_TRACK_THUMB_H
#define SPID_TRACK_THUMB_H

#define THUMB 28                /* its side */
#define THUMB_FLAT 0.01         /* deviation below which nothing is shown */

/* Mean-free grey picture (THUMB,THUMB), unit length, of a crop (224,224,3);
 * returns its standard deviation before. */
double thumb_make(float *thumb, const float *input);
/* Correlation of two of them, -1 to 1. */
double thumb_correlate(const float *a, const float *b);

#endif
