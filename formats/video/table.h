/* Inside video.so: what its table is made of. */
#ifndef SPID_FORMATS_VIDEO_TABLE_H
#define SPID_FORMATS_VIDEO_TABLE_H

#include "formats/module.h"

/* As video_open, video_create and so on promise (formats/video.h). */
struct video_reader *reader_open(const char *path, bool bt601,
                                 struct error *err);
struct video_writer *writer_create(const char *path, size_t width,
                                   size_t height, double rate,
                                   struct error *err);
int writer_write(struct video_writer *v, const uint8_t *rgb,
                 struct error *err);
int writer_finish(struct video_writer *v, struct error *err);
void writer_abandon(struct video_writer *v);

/* "file:" and the path, to be freed: a name with a colon is no address.  NULL
 * without memory. */
char *reader_url(const char *path);

/* What players take for BT.709 when the file does not say. */
static inline bool video_is_hd(int width, int height)
{
    return width >= 1280 || height > 576;
}

#endif
