/* IMAG records: a picture, and what is known of its pixels. */
#ifndef SPID_STREAM_IMAG_H
#define SPID_STREAM_IMAG_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/stream/stream.h"

/* The arrays of an IMAG record; any but rgb may be NULL.  After imag_read they
 * lie in the record and live as long. */
struct imag {
    size_t height, width;   /* pixels */
    const uint8_t *rgb;     /* (height,width,3) sRGB */
    const uint8_t *alpha;   /* (height,width) coverage, of what is drawn */
    const uint8_t *mask;    /* (height,width) true coverage of the person */
    const uint8_t *label;   /* (height,width) region numbers */
    const uint8_t *alone;   /* (height,width,3) the person alone */
};

/* A training picture: square, with a mask.  -1 and *err naming the array when
 * one is missing, of another type or shape, or the picture is not square. */
int imag_read(struct imag *im, const struct record *rec, struct error *err);
/* Its pixels a side, by its height; 0: it has no picture. */
size_t imag_size(const struct record *rec);
/* Write the arrays that are not NULL. */
int imag_write(struct stream_writer *w, uint64_t frame, double time,
               const struct imag *im, struct error *err);

#endif
