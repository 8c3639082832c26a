/* Inside video.so: what its table is made of. */
#ifndef SPID_FORMATS_VIDEO_TABLE_H
#define SPID_FORMATS_VIDEO_TABLE_H

#include "formats/module.h"

/* What formats/video.h promises of video_open. */
struct video_reader *reader_open(const char *path, bool bt601,
                                 struct error *err);
/* video_create's. */
struct video_writer *writer_create(const char *path, size_t width,
                                   size_t height, double rate,
                                   struct error *err);
/* video_write's. */
int writer_write(struct video_writer *v, const uint8_t *rgb, double time,
                 struct error *err);
/* video_finish's. */
int writer_finish(struct video_writer *v, struct error *err);
/* video_abandon's. */
void writer_abandon(struct video_writer *v);

/* Whether the end of the file is missing, by what its container says of its
 * length.  Moves the place that is read next. */
struct AVFormatContext;
struct AVStream;
bool video_is_cut(const struct AVFormatContext *file,
                  const struct AVStream *stream);

/* "file:" and the path, to be freed: a name with a colon is no address.  NULL
 * without memory. */
char *reader_url(const char *path);

/* What players take for BT.709 when the file does not say. */
static inline bool video_is_hd(int width, int height)
{
    return width >= 1280 || height > 576;
}

#endif
