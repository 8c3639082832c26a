/* The background behind a person, filled in. */
#ifndef SPID_PHOTO_BACKDROP_H
#define SPID_PHOTO_BACKDROP_H

#include "formats/framesink.h"
#include "lib/head/person.h"
#include "lib/photo/matting.h"

/* m->back where m->alpha is more than MATTING_BACK and beyond the picture, from
 * where it is known; alpha grows where a pixel could not be what it is before
 * that. */
int backdrop_fill(struct matting *m, struct error *err);

/* --background source: bg is p's picture without the person: p->back, or where
 * that is NULL, filled in.  The caller releases bg. */
int backdrop_of_person(struct background *bg, const struct person *p,
                       struct error *err);

#endif
