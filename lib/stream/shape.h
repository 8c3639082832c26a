/* SHAP records: the identity beta of one person. */
#ifndef SPID_STREAM_SHAPE_H
#define SPID_STREAM_SHAPE_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/stream/stream.h"

/* The arrays of a SHAP record; they lie in the record and live as long. */
struct shape {
    const float *beta;          /* (n) standard deviations */
    size_t n;
    const float *offset;        /* (vertices,3) that the person's rest mesh is
                                 * moved by, head units; NULL: none */
    size_t vertices;
    const int32_t *person;      /* (1) number in a data set; NULL: not said */
};

/* -1 and *err when beta is missing, one is of another type or not finite. */
int shape_read(struct shape *s, const struct record *rec, struct error *err);
/* Write SHAP; -1 when the stream cannot be written. */
int shape_write(struct stream_writer *w, uint64_t frame, double time,
                const struct shape *s, struct error *err);

#endif
