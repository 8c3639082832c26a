/* Video files by ffmpeg's libraries, cameras by OpenCV, each in a module. */
#ifndef SPID_FORMATS_VIDEO_H
#define SPID_FORMATS_VIDEO_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"

struct video_reader;

/* Whether the name is a camera's: "camera:N" or "/dev/videoN". */
bool video_is_camera(const char *path);
/* Whether it is, or the address of a stream ("rtsp://..."): frames come when
 * they come, and it has no end. */
bool video_is_live(const char *path);
/* Open a file, or what video_is_live says.  EX_NOINPUT when it is not there,
 * EX_DATAERR when no decoder takes it.  Frames leave through the door
 * (formats/door.h): turned or mirrored, with square pixels and cropped as the
 * file says, fields woven to whole frames (bwdif), colours by the matrix,
 * range, primaries and transfer that it says; where it does not name a matrix,
 * BT.709 from 1280 columns or 577 rows on, else BT.601.  bt601: BT.601 whatever
 * it says. */
struct video_reader *video_open(const char *path, bool bt601,
                                struct error *err);
/* Frames a second; 0 when unknown. */
double video_rate(const struct video_reader *v);
/* Frames the container announces, about; 0 when unknown. */
size_t video_frames(const struct video_reader *v);
/* When the last frame that was read ceases to be shown, seconds as its time. */
double video_end(const struct video_reader *v);
/* Next frame as RGB: 1 and *rgb (valid until the next call), the size and the
 * time in seconds of the container; 0 at the end; -1 on a fault, also where
 * the end is one: the file is shorter than it says, ends inside a packet, or
 * more than two frames and one of a hundred could not be decoded. */
int video_read(struct video_reader *v, const uint8_t **rgb, size_t *width,
               size_t *height, double *time, struct error *err);
void video_close(struct video_reader *v);         /* NULL is allowed */

struct video_writer;

/* Write path (the container by its extension) as H.264, or MPEG-4 part 2
 * where there is no encoder for it (.webm: VP9).  Odd sizes get one more
 * column or row.  Colours by BT.601, or BT.709 where players assume it (see
 * video_open), and tagged so.  The file is complete after video_finish, and
 * the same bytes for any number of threads. */
struct video_writer *video_create(const char *path, size_t width,
                                  size_t height, double rate,
                                  struct error *err);
/* One frame more, rgb (height,width,3), shown from `time` seconds on, in steps
 * of the rate: a driver whose rate varies is followed in its own time. */
int video_write(struct video_writer *v, const uint8_t *rgb, double time,
                struct error *err);
/* Write what is left and close: -1 when not all could be written. */
int video_finish(struct video_writer *v, struct error *err);
void video_abandon(struct video_writer *v);       /* NULL is allowed */

#endif
