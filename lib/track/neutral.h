/* The driver's frame at rest, which relative motion (relative.h) starts from:
 * the first with a face, a numbered one, or the one of least tension, for
 * which the clip is looked through once before it drives anything. */
#ifndef SPID_TRACK_NEUTRAL_H
#define SPID_TRACK_NEUTRAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "formats/framesource.h"
#include "lib/base/error.h"
#include "lib/head/lbs.h"
#include "lib/net/motion_encoder.h"
#include "lib/track/track.h"

struct neutral {
    bool given;                 /* false: the first frame with a face */
    bool automatic;             /* the frame of least tension */
    uint64_t frame;             /* or this one, counted from 0 */
};

/* "first", "auto" or a frame's number; dest is a struct neutral.  EX_USAGE for
 * anything else. */
int neutral_parse(const char *value, void *dest, struct error *err);

/* What is looked through, and by what; all borrowed. */
struct neutral_clip {
    const char *const *path;
    size_t count;
    const struct framesource_options *frames;
    const struct track_options *track;
    const struct identity *id;
    struct motion_encoder *net;
    size_t nexp;                /* components of expression */
};

/* *m: the motion of the frame that n, given, says; frames without a face
 * cannot be it.  EX_USAGE when a path can be read only once (standard input,
 * cameras), EX_DATAERR when the clip has no such frame. */
int neutral_find(struct motion *m, const struct neutral *n,
                 const struct neutral_clip *clip, struct error *err);

#endif
