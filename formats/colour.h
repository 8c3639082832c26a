/* Colours as files tag them, to sRGB, by littlecms2: ICC profiles, the code
 * points of video and of HEIF, high dynamic range. */
#ifndef SPID_FORMATS_COLOUR_H
#define SPID_FORMATS_COLOUR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* What a file says of its colours; zeroed: nothing, so sRGB.  The first that
 * is there counts. */
struct colour_tag {
    const uint8_t *icc;         /* an ICC profile; borrowed */
    size_t icc_bytes;
    int primaries, transfer;    /* code points of ITU-T H.273; 0, 2: not said */
    double gamma;               /* exponent that gives light; 0: not said */
    double chroma[8];           /* x, y of white, red, green and blue, beside
                                 * gamma; white 0: those of sRGB */
    double peak;                /* cd/m2 of the brightest pixel of what is
                                 * coded as PQ or HLG; 0: 1000 */
};

/* How pixels lie in a row: the channels of colour, then others. */
struct colour_pixels {
    int channels;               /* 1 grey, 3 RGB, 4 CMYK */
    int extra;                  /* alpha and the like, passed over */
    int bits;                   /* 8 or 16 (native byte order) */
    bool inverted;              /* CMYK: 0 is full ink, as Adobe's JPEGs */
};

struct colour;

/* What brings such pixels to sRGB: perceptual intent, as littlecms's own
 * tools.  High dynamic range (PQ, HLG) has its diffuse white, 203 cd/m2 (ITU-R
 * BT.2408), near white and what is brighter rolled off (BT.2390).  NULL when
 * they are sRGB within a level, when the tag does not go with the pixels, or
 * without memory; CMYK then has no colours. */
struct colour *colour_open(const struct colour_tag *tag,
                           struct colour_pixels pixels);
/* rgb (n,3) 8-bit sRGB, out, from n pixels of a row.  From any thread.  c NULL:
 * as they are, grey spread, 16 bits rounded. */
void colour_row(const struct colour *c, uint8_t *rgb, const void *row,
                size_t n, struct colour_pixels pixels);
void colour_close(struct colour *c);              /* NULL is allowed */

#endif
