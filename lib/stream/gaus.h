/* GAUS records: a whole set of Gaussians with what moves them. */
#ifndef SPID_STREAM_GAUS_H
#define SPID_STREAM_GAUS_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/stream/stream.h"

/* The arrays of a GAUS record.  After gaus_read they lie in the record and
 * live as long; those that a record may leave out are NULL then. */
struct gaus {
    size_t n, channels;
    const float *mean, *scale;          /* (n,3) head units */
    const float *quat;                  /* (n,4) w first */
    const float *opacity;               /* (n) */
    const float *color;                 /* (n,channels), or */
    const uint16_t *color_half;         /* the same in half precision */
    const uint8_t *branch;              /* (n) 0 dynamic, 1 static, 2 mouth */
    const int32_t *vertex;              /* (vertices) densified vertex of */
    size_t vertices;                    /* each dynamic Gaussian */
    const float *lip;                   /* (3) the source's lip centroid */
    const float *jaw;                   /* (jaws,3) how the mouth's move */
    size_t jaws;                        /* with the chin (drive_jaw), and */
    const float *chin;                  /* (3) the source's: both or none */
    const float *bend;                  /* (n) neck blend's weights */
    const float *pivot;                 /* (3) in the neck */
    const float *source;                /* (3,3) R of the source's camera */
    const float *light;                 /* (3) on the source, head frame */
    const float *lamp;                  /* (6) it is shown in, camera frame */
    const float *uv;                    /* (n,2) places in SRCI, 0..1, */
    const float *seen;                  /* (n) how far it shows them, and */
    const float *view;                  /* (3,4) its camera: all or none */
    const float *reach;                 /* (n) up to where it does, and */
    const float *normal;                /* (n,3) of the surface, head frame */
    const float *tilt;                  /* (n,2) how depth rises there */
    const float *cam;                   /* (3,4) [R|t] */
};

/* -1 and *err naming the array when one is missing, of another type or shape,
 * or not finite. */
int gaus_read(struct gaus *g, const struct record *rec, struct error *err);
/* The arrays that are not NULL, into a; returns how many. */
int gaus_arrays(struct array a[STREAM_MAX_ARRAYS], const struct gaus *g);
/* Write them. */
int gaus_write(struct stream_writer *w, uint64_t frame, double time,
               const struct gaus *g, struct error *err);

#endif
