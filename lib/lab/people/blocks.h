/* What JPEG and video codecs have in common: luma beside both chromas at half
 * the resolution (4:2:0), and cosine transforms of 8 x 8 blocks. */
#ifndef SPID_LAB_PEOPLE_BLOCKS_H
#define SPID_LAB_PEOPLE_BLOCKS_H

#include <stdint.h>

/* The planes of a picture of n x n pixels, in one block of scratch (n,n,3). */
struct blocks {
    int n, m;                   /* m = (n + 1) / 2 */
    float *luma;                /* (n,n) less 128 */
    float *cb, *cr;             /* (m,m), means of two by two pixels */
};

/* From rgb (n,n,3), BT.601. */
struct blocks blocks_split(float *scratch, const uint8_t *rgb, int n);
/* And back into rgb. */
void blocks_join(uint8_t *rgb, const struct blocks *b);

/* Give the cosine coefficients of every block of a plane (n,n), slowest first
 * in rows of eight, to quantise, and put back what it makes of them.  Blocks
 * start at multiples of 8; the last ones repeat the border. */
void blocks_quantise(float *plane, int n,
                     void (*quantise)(float b[64], const void *ctx),
                     const void *ctx);

#endif
