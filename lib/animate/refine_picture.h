/* A frame's finished picture: refined, the photograph over it, and enlarged
 * where a larger picture than the features' is asked for. */
#ifndef SPID_ANIMATE_REFINE_PICTURE_H
#define SPID_ANIMATE_REFINE_PICTURE_H

#include <stddef.h>

#include "lib/base/error.h"
#include "lib/animate/refine.h"
#include "lib/photo/texture.h"
#include "lib/photo/zoom.h"

struct refine_picture {
    size_t size;                /* set by the caller: pixels a side; 0: as many
                                 * as the features have */
    const struct texture *texture;      /* the photograph, borrowed; NULL:
                                         * none */
    struct zoom zoom;           /* to size */
    float *rgb, *alpha;         /* (height,width,3), (height,width) of the
                                 * features */
    float *said;                /* the field's numbers */
    size_t room, places;        /* pixels in them; places */
    const float *shown;         /* (height,width,5) the photograph, or NULL, */
    struct texture_field field; /* and what is said of it */
    /* the picture, until the next one: */
    size_t height, width;
    const float *color;         /* (height,width,3) premultiplied */
    const float *coverage;      /* (height,width), or NULL: opaque */
};

/* Room for a frame, and r's refined colours into p->rgb.  Frames are refined in
 * turn (refine_frame). */
int refine_picture_refine(struct refine_picture *p, struct refine *r,
                          const struct feat *in, struct error *err);

/* p->color and p->coverage from them; other frames may be refined meanwhile,
 * but for packed ones.  EX_DATAERR when features that are to be
 * enlarged are not square, too large already, or have no alpha. */
int refine_picture_finish(struct refine_picture *p,
                          const struct feat *in, struct error *err);

/* Largest error and its dB against all of the frame refined in float, before
 * the photograph; -1: that could not be done. */
int refine_picture_compare(double *max, double *db,
                           const struct refine_picture *p,
                           const struct refine *r,
                           const struct feat *in, struct error *err);

/* Free what it holds; zeroed then. */
void refine_picture_release(struct refine_picture *p);

#endif
