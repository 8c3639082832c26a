/* Eq. SR on frames of a stream: from FEAT to the final picture, all of it or
 * only where the head is. */
#ifndef SPID_ANIMATE_REFINE_H
#define SPID_ANIMATE_REFINE_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/error.h"
#include "lib/net/model.h"
#include "lib/net/refiner.h"
#include "lib/nn/params.h"
#include "lib/photo/texture.h"
#include "lib/stream/records.h"

#define REFINE_STEP 32         /* sides of what is refined are multiples */
#define REFINE_MARGIN 24       /* pixels about the head that count too */

/* One planned network for one size. */
struct refine_plan {
    struct params ps;
    struct refiner net;
    size_t height, width;       /* 0: none */
};

struct refine {
    const struct model *model;  /* borrowed */
    enum nn_type type;
    bool roi;
    struct refine_plan plan;
    size_t top, left;           /* of the part that is refined */
    float *part, *out;          /* its features and colours */
    size_t part_room, out_room;
    float *seen;                /* coarse colours of the picture that the
                                 * network saw last, and of this one: (2,
                                 * height/4,width/4,3) */
    size_t seen_room, seen_top, seen_left;
    bool has_seen, seen_photo;
    size_t *start;              /* of packed features, the rows' places */
    size_t start_room;
    void *all;                  /* unpacked, where the network wants it */
    size_t all_room;
    const float *shown;         /* (height,width,5) the frame's photograph, or
                                 * NULL */
    float *photo, *photo_part;  /* unpacked; the part of it, or zeros */
    size_t photo_room, photo_part_room;
    size_t plans;               /* how often a size was planned */
};

/* Prepare the refiner of a model, which must stay open until refine_release.
 * EX_CONFIG when it has none. */
int refine_open(struct refine *r, const struct model *m, enum nn_type type,
                bool roi, struct error *err);
/* Free what it holds; zeroed then. */
void refine_release(struct refine *r);

/* rgb [height,width,3] from the features of frames in turn: where one shows
 * nearly what the network saw last, it gets what was said of that
 * (refine.c says how nearly; never with NN_F32).  The network is planned at the
 * first frame, and again when the size changes or the head outgrows the part
 * (roi).  Outside the part the coarse colours stay.  EX_DATAERR when the
 * channels are not the refiner's, or the packed pixels not as many as alpha
 * covers. */
int refine_frame(float *rgb, struct refine *r, const struct feat *in,
                 struct error *err);

/* Places of the field along n pixels of a picture. */
size_t refine_places(size_t n);
/* What was said of the photograph in the last refine_frame, for the whole picture:
 * nothing outside the part; .at NULL when it was shown none or nothing is said.
 * said: its room, a TEXTURE_FIELD for each of the places. */
struct texture_field refine_field(float *said, const struct refine *r,
                                  const struct feat *in);

#endif
