/* IMAG records of training pictures: square ones, and what is known of their
 * pixels.  (Pictures that programs put out are formats/framesink.h's.) */
#ifndef SPID_RECORD_IMAG_H
#define SPID_RECORD_IMAG_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/stream/stream.h"

/* The arrays of an IMAG record.  After imag_read they lie in the record and
 * live as long. */
struct imag {
    size_t size;            /* pixels a side */
    const uint8_t *rgb;     /* (size,size,3) sRGB */
    const uint8_t *mask;    /* (size,size) true coverage of the person */
    const uint8_t *label;   /* (size,size) region numbers, or NULL */
    const uint8_t *alone;   /* (size,size,3) the person alone, or NULL */
};

/* -1 and *err naming the array when the picture or its mask is missing, or one
 * is of another type or not square. */
int imag_read(struct imag *im, const struct record *rec, struct error *err);
/* Its pixels a side, by its height; 0: it has no picture. */
size_t imag_size(const struct record *rec);
/* Write the arrays that are not NULL. */
int imag_write(struct stream_writer *w, uint64_t frame, double time,
               const struct imag *im, struct error *err);

#endif
