/* What spid-motion writes: a stream, a take, a video of what it saw. */
#ifndef SPID_CMD_MOTION_OUTPUT_H
#define SPID_CMD_MOTION_OUTPUT_H

#include "formats/framesink.h"
#include "formats/framesource.h"
#include "formats/livelink.h"
#include "lib/base/error.h"
#include "lib/head/lbs.h"
#include "lib/stream/stream.h"
#include "lib/track/conf.h"
#include "lib/track/driver.h"
#include "lib/photo/overlay.h"

struct motion_output {
    struct stream_writer *stream;       /* NULL: --arkit alone */
    struct livelink_writer *take;       /* NULL without --arkit */
    struct framesink *drawn;            /* NULL without --overlay */
    struct overlay overlay;
    uint64_t drawn_frames;
};

/* Open what is named; a path that is NULL is not asked for, and the stream
 * goes to standard output when neither it nor the take is. */
int motion_output_open(struct motion_output *o, const char *stream,
                       const char *take, const char *overlay,
                       const struct identity *id, struct error *err);
/* CONF, and the take's header. */
int motion_output_begin(struct motion_output *o, const struct conf *conf,
                        const char *take, struct error *err);
/* One frame's MOTN and row. */
int motion_output_write(struct motion_output *o, const struct driver_frame *f,
                        size_t nexp, struct error *err);
/* One frame of the video; r is NULL for a frame before the first face.  size
 * is the portrait window's in pixels, num / den the rate. */
int motion_output_draw(struct motion_output *o, const struct frame *f,
                       const struct track_result *r,
                       const struct square *window, double size, int num,
                       int den, struct error *err);
/* Complete all of them; when rc < 0, *err says why they are given up.  0 or
 * -1. */
int motion_output_close(struct motion_output *o, int rc, struct error *err);
/* Leave no output under its final name. */
void motion_output_abandon(struct motion_output *o);

#endif
