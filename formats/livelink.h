/* Takes of Epic's Live Link Face app, and of programs that write the like: a
 * CSV of ARKit's 52 blendshape weights and nine angles, a row for every picture
 * of the phone's camera.
 *
 *   Timecode,BlendShapeCount,EyeBlinkLeft,...,TongueOut,HeadYaw,...
 *   12:21:59:06.595,61,0.0009391578,...
 *   12:21:59:08.595,0
 *
 * The last part of a timecode counts frames within the second, with a
 * fraction.  A row of no blendshapes is a picture in which the app saw no
 * face.  Angles are radians; lib/track/take.h says which way they turn. */
#ifndef SPID_FORMATS_LIVELINK_H
#define SPID_FORMATS_LIVELINK_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/error.h"

/* Places of a row's numbers: weights, then angles. */
#define LIVELINK_WEIGHTS 52
#define LIVELINK_CHANNELS 61
enum livelink_angles {
    LIVELINK_HEAD = LIVELINK_WEIGHTS,   /* yaw, pitch, roll */
    LIVELINK_LEFT_EYE = LIVELINK_HEAD + 3,
    LIVELINK_RIGHT_EYE = LIVELINK_HEAD + 6
};

/* The header's name of channel k: "EyeBlinkLeft". */
const char *livelink_channel(int k);

/* ---- reading ----------------------------------------------------------- */

struct livelink_frame {
    double time;        /* seconds since the first row */
    bool held;          /* no face, or no row: value is the frame's before it,
                         * zeros before the first face */
    const float *value; /* (LIVELINK_CHANNELS), until the next call */
};

struct livelink;

/* Whether path is a file whose first line has such names: a take, not a
 * picture, a video or a stream. */
bool livelink_probe(const char *path);
/* Open path ("-": standard input) and read its header.  The columns may stand
 * in any order, between commas, semicolons or tabs, and numbers have a decimal
 * comma where commas are none between them.  A name counts by its letters,
 * large or small, with L or R for a side ("EyeBlink_L"); two sides of one
 * weight are its mean.  Weights must all be there except TongueOut, an angle
 * that is missing is 0.  rate: frames of a second in the timecodes; 0 takes it
 * from the largest one in a file, 60 in a pipe.  NULL and *err, which names
 * file, row and column. */
struct livelink *livelink_open(const char *path, double rate,
                               struct error *err);
/* The next frame: 1; 0 at the end; -1.  Rows that are missing by their
 * timecodes, up to a minute, are made up: held.  Of rows of one timecode the
 * first counts. */
int livelink_read(struct livelink *l, struct livelink_frame *f,
                  struct error *err);
/* Rows left out so far, since an earlier one had their timecode. */
size_t livelink_repeated(const struct livelink *l);
/* The rate used. */
double livelink_rate(const struct livelink *l);
/* Names of columns that mean nothing here, with commas, and how many; NULL
 * when there are none. */
const char *livelink_unknown(const struct livelink *l, size_t *count);
void livelink_close(struct livelink *l);        /* NULL is allowed */

/* ---- writing ----------------------------------------------------------- */

struct livelink_writer;

/* Write such a file, or to standard output ("-"), a row at a time and at once.
 * rate: frames of a second, for the timecodes; a fraction counts as the next
 * whole number, as timecodes of 29.97 pictures a second do.  NULL and *err. */
struct livelink_writer *livelink_create(const char *path, double rate,
                                        struct error *err);
/* A row at time seconds; value (LIVELINK_CHANNELS) is NULL when no face was
 * seen. */
int livelink_write(struct livelink_writer *w, double time, const float *value,
                   struct error *err);
/* The file takes its name.  The writer is released in any case. */
int livelink_finish(struct livelink_writer *w, struct error *err);
void livelink_abandon(struct livelink_writer *w);       /* NULL is allowed */

#endif
