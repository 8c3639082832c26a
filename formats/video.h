/* Video files and addresses by ffmpeg's libraries, cameras by OpenCV, each in a
 * module. */
#ifndef SPID_FORMATS_VIDEO_H
#define SPID_FORMATS_VIDEO_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"

/* What every reader begins with. */
struct video_reader {
    const struct video_reading *by;     /* formats/module.h */
    double rate;            /* frames a second; 0: unknown */
    size_t frames;          /* about as many are announced; 0: unknown */
    double end;             /* when the last frame that was read ceases to be
                             * shown, seconds as its time */
    bool sounds;            /* the file has sound, too */
};

/* Whether the name is a camera's: "camera:N" or "/dev/videoN". */
bool video_is_camera(const char *path);
/* Whether it is, or the address of a stream ("rtsp://..."): frames come when
 * they come, and it has no end. */
bool video_is_live(const char *path);
/* Whether a file that begins so is an animation of WebP. */
bool video_is_webp(const uint8_t *begin, size_t n);
/* Open a file, or what video_is_live says.  EX_NOINPUT when it is not there (an
 * address: or sends nothing for ten seconds, which later is its end),
 * EX_DATAERR when no decoder takes it.  Frames leave through the door
 * (formats/door.h): turned or mirrored, with square pixels and cropped as the
 * file says, fields woven to whole frames (bwdif), colours by the matrix,
 * range, primaries and transfer that it says; where it does not name a matrix,
 * BT.709 from 1280 columns or 577 rows on, else BT.601.  bt601: BT.601 whatever
 * it says. */
struct video_reader *video_open(const char *path, bool bt601,
                                struct error *err);
/* Next frame as RGB: 1 and *rgb (valid until the next call), the size and the
 * time in seconds of the container; 0 at the end; -1 on a fault, also where
 * the end is one: the file is shorter than it says, ends inside a packet, or
 * more than two frames and one of a hundred could not be decoded. */
int video_read(struct video_reader *v, const uint8_t **rgb, size_t *width,
               size_t *height, double *time, struct error *err);
void video_close(struct video_reader *v);         /* NULL is allowed */

struct video_writer;

struct video_options {
    size_t width, height;
    double rate;                /* frames a second */
    bool alpha;                 /* frames are RGBA, straight */
    const char *sound;          /* a clip whose sound goes along, or NULL; */
    double start;               /* ... its time of the first frame */
    const char *comment;        /* for containers that have one, or NULL */
};

/* Whether such a video keeps alpha: WebM and Matroska (VP9), MOV (ProRes 4444),
 * GIF, WebP and APNG do. */
bool video_has_alpha(const char *path);
/* Whether it takes sound: not the animations. */
bool video_has_sound(const char *path);
/* Write path (the container by its extension) as H.264, or MPEG-4 part 2
 * where there is no encoder for it; .webm: VP9; .gif, .webp and .apng or .png:
 * animations that repeat for ever.  Odd sizes of video get one more column or
 * row.  Colours by BT.601, or BT.709 where players assume it (see video_open),
 * and tagged so.  Sound is copied where the container takes it, or else coded
 * as AAC (WebM: Opus, AVI: MP3), in step with the frames; what the clip has
 * before its first picture stays before it.  The file is complete after
 * video_finish, and the same bytes for any number of threads. */
struct video_writer *video_create(const char *path,
                                  const struct video_options *opt,
                                  struct error *err);
/* One frame more, (height,width,3 or 4), shown from `time` seconds on, in steps
 * of the rate (animations: of their own): a driver whose rate varies is
 * followed in its own time. */
int video_write(struct video_writer *v, const uint8_t *pixel, double time,
                struct error *err);
/* Write what is left and close: -1 when not all could be written.  end: the
 * time until which the last frame is shown; 0: for a step of the rate. */
int video_finish(struct video_writer *v, double end, struct error *err);

#endif
