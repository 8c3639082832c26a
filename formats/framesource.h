/* Frames in: video files, picture files, folders and lists of pictures,
 * Y4M/PAM/PPM/PNG streams (files or standard input), cameras. */
#ifndef SPID_FORMATS_FRAMESOURCE_H
#define SPID_FORMATS_FRAMESOURCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "formats/image.h"
#include "lib/base/error.h"

struct framesource_options {
    double rate;            /* frames a second where the input has no times;
                             * 0: 25 */
    bool bt601;             /* Y4M and videos: BT.601 (otherwise Y4M BT.709,
                             * videos as they say) */
    size_t max_pixels;      /* of a frame; 0: IMAGE_MAX_PIXELS */
};

struct frame {
    size_t width, height;
    const uint8_t *rgb;     /* [height, width, 3]; valid until the next read */
    uint64_t index;         /* from 0, in the order delivered */
    double time;            /* seconds from the first frame */
    bool restart;           /* set by lib/animate/live.h: nothing is where it
                             * was in the frame before */
};

/* An image of the frame's pixels, for image_release.  -1: EX_OSERR. */
int frame_copy(struct image *im, const struct frame *f, struct error *err);

struct framesource;

/* Open the inputs, read one after the other as one clip: "-" is a stream on
 * standard input, a directory means its pictures in natural order, "@FILE" a
 * list with one name per line, "camera:N" or "/dev/videoN" a device; an address
 * such as "rtsp://..." is opened as a video, a fifo like standard input.  NULL
 * on failure.  A
 * picture without frames and an empty stream are EX_DATAERR. */
struct framesource *framesource_open(const char *const *paths, size_t count,
                                     const struct framesource_options *opt,
                                     struct error *err);

/* Next frame.  1: *f is filled.  0: the end.  -1: the input is damaged or
 * short; every frame before the fault has been delivered and *err names the
 * file and the frame (EX_DATAERR). */
int framesource_read(struct framesource *s, struct frame *f,
                     struct error *err);

/* Frames a second as a fraction, known after the first frame; {25, 1} when
 * the input does not say. */
void framesource_rate(const struct framesource *s, int *num, int *den);

/* When the last frame delivered ceases to be shown, in the frames' times. */
double framesource_end(const struct framesource *s);

/* The clip that the frames are of, where it is one file that has sound, and
 * the time in it of the first frame; NULL otherwise, and before that. */
const char *framesource_sound(const struct framesource *s, double *start);

/* Whether one of the inputs is the file of that name, or among the files of
 * that pattern: what must not be written. */
bool framesource_reads(const struct framesource *s, const char *name);

/* Whether all inputs are files: there from the first frame to the last, and not
 * coming as a camera's, an address's or a pipe's do. */
bool framesource_recorded(const struct framesource *s);

/* Number of frames if it can be known, else 0 (for progress bars). */
size_t framesource_total(const struct framesource *s);

/* How many of the pictures delivered were damaged (struct image). */
size_t framesource_damaged(const struct framesource *s);

/* Name of the input the last frame came from, for messages. */
const char *framesource_name(const struct framesource *s);

void framesource_close(struct framesource *s);    /* NULL is allowed */

#endif
