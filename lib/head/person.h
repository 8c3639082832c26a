/* A person as an identity file holds them: CONF, SRCI (the source picture),
 * SHAP and the source's own MOTN, then an SRCI with its own motion for each
 * further picture.  spid-shape writes it, spid-branches --bake
 * adds the Gaussians. */
#ifndef SPID_HEAD_PERSON_H
#define SPID_HEAD_PERSON_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/head/head.h"
#include "lib/head/lbs.h"
#include "lib/head/motion.h"
#include "lib/stream/stream.h"

#define PERSON_MAX 2048         /* pixels along a side of the picture */
#define PERSON_MORE 7           /* further pictures, at most */

/* Owned copies; absent parts are NULL or 0. */
struct person {
    float *shape;               /* (nshape) beta */
    size_t nshape;
    float *offset;              /* (noffset,3) of the head's vertices at rest,
                                 * head units */
    size_t noffset;
    uint8_t *rgb, *matte;       /* (size,size,3), (size,size) */
    uint8_t *back;              /* (size,size,3) what the person hides */
    uint8_t *confidence;              /* (size,size) certainty of the matte: 255 less
                                 * twice its standard deviation; NULL: sure */
    size_t size;                /* the window's in the source picture, from
                                 * what the networks see up to PERSON_MAX */
    float crop[3];              /* of the source picture in its file */
    struct motion source;       /* the source's own motion */
    struct motion calm;         /* the same with the person's face at rest, as
                                 * far as it is known */
    bool has_source;
    struct person *more;        /* (nmore) further pictures: rgb, matte, back,
                                 * confidence, size, crop and source of each */
    size_t nmore;
    char head[17], model[17];   /* hashes of CONF: "head_hash",
                                 * "model_hash"; "" when it has none */
};

/* *out, the shape or offset of a person, freed first, = a copy of n numbers, or
 * NULL. */
int person_copy(float **out, const float *x, size_t n, struct error *err);
/* Whether an SRCI record is of a further picture: it has its own motion. */
bool person_is_further(const struct record *srci);
/* Take what one record holds; 1: it was part of an identity, 0: another
 * record, -1: damaged.  nexp as in motion_read. */
int person_read_record(struct person *p, const struct record *rec, size_t nexp,
                       struct error *err);
/* Read an identity file up to its END.  Fails when it has no SHAP. */
int person_load(struct person *p, const char *path, size_t nexp,
                struct error *err);
/* Only its source picture (SRCI); fails when it has none. */
int person_load_picture(struct person *p, const char *path,
                        struct error *err);
/* The picture of p and its parts as size by size pixels into q, which has no
 * other parts; the caller releases q. */
int person_resize(struct person *q, const struct person *p, size_t size,
                  struct error *err);
/* Write the source picture's SRCI (frame 0). */
int person_write_picture(struct stream_writer *w, const struct person *p,
                         struct error *err);
/* Write SRCI, SHAP and MOTN (frame 0), in this order, then the SRCI of the
 * further pictures (frame 1 and so on). */
int person_write(struct stream_writer *w, const struct person *p, size_t nexp,
                 struct error *err);
/* Free what it holds; zeroed then. */
void person_release(struct person *p);

/* Fold the person's beta and offset into h; fails when the identity was made
 * for another head (its CONF names it, or its offset is of another mesh). */
int person_fold(struct identity *id, const struct head *h,
                const struct person *p, struct error *err);

#endif
