/* GMOV records: what of a set of Gaussians moved in a frame. */
#ifndef SPID_STREAM_GMOV_H
#define SPID_STREAM_GMOV_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/stream/stream.h"

/* The arrays of a GMOV record; all may be left out (NULL).  After gmov_read
 * they lie in the record and live as long. */
struct gmov {
    const float *cam;       /* (3,4) [R|t] */
    const int32_t *first;   /* (1) number of the first of mean: both or none */
    const float *mean;      /* (count,3) new centres */
    size_t count;
    const float *shift;     /* (3) of the mouth as a whole */
    const float *chin;      /* (3) of the chin, with which the mouth goes */
    const float *body;      /* (3,4) the shoulders' motion */
};

/* -1 and *err naming the array when one is of another type or shape or not
 * finite. */
int gmov_read(struct gmov *m, const struct record *rec, struct error *err);
/* The arrays that are not NULL, into a; returns how many.  m must outlive
 * them. */
int gmov_arrays(struct array a[STREAM_MAX_ARRAYS], const struct gmov *m);

#endif
