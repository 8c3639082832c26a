/* FEAT records: a feature image, as the splat stage writes it and the refiner
 * reads it, with what the photograph shows there. */
#ifndef SPID_STREAM_FEAT_H
#define SPID_STREAM_FEAT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/uio.h>

#include "lib/base/error.h"
#include "lib/stream/stream.h"

#define FEAT_PHOTO 5    /* numbers of a pixel of photo, */
#define FEAT_PLACE 4    /* of place, */
#define FEAT_MAP 17     /* of the places' view */
#define FEAT_GAIN 4    /* pixels from one number of gain to the next, */
#define FEAT_TURN 6     /* and of the head's turn */

/* The arrays of a FEAT record; NULL: not there.  After feat_read they lie in
 * the record and live as long. */
struct feat {
    size_t height, width, channels;
    const float *f32;       /* (height,width,channels), or packed: only the */
    const uint16_t *f16;    /* pixels (pixels,channels) whose alpha is not 0,
                             * row after row; halves if f32 is NULL */
    bool packed;
    size_t pixels;          /* of packed ones */
    const float *alpha;     /* (height,width) */
    const float *depth;     /* (height,width) camera z; not read */
    const float *photo;     /* (height,width,5), packed (pixels,5): what the
                             * photograph shows (lib/photo) */
    const float *place;     /* (height,width,4) blended places, */
    const float *map;       /* (17) and their view (lib/splat/types.h) */
    const float *gain;      /* (gain_height,gain_width) gains of the
                             * colours, a quarter of the picture's size
                             * (lib/splat/relight.h) */
    size_t gain_height, gain_width;
    const float *tint;      /* (3) and of red, green and blue everywhere */
    const float *turn;      /* (6) the head's since the source
                             * (lib/base/relative_pose.h) */
};

/* EX_DATAERR naming the array for shapes that do not agree, numbers that are
 * not finite, and packed features that stand for more than --max-bytes. */
int feat_read(struct feat *f, const struct record *rec, struct error *err);
/* Write the arrays that are not NULL.  Packed features may lie scattered, in
 * parts (stream_write_parts), their pointer is then only a sign of their
 * type. */
int feat_write(struct stream_writer *w, uint64_t frame, double time,
               const struct feat *f, const struct iovec *part, size_t parts,
               struct error *err);

#endif
