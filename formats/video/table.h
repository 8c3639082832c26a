/* Inside video.so: what its table is made of. */
#ifndef SPID_FORMATS_VIDEO_TABLE_H
#define SPID_FORMATS_VIDEO_TABLE_H

#include "formats/module.h"

/* What formats/video.h promises of video_open; to_rgb: the program's
 * y4m_rows_to_rgb. */
struct video_reader *reader_open(const char *path, bool bt601,
                                 y4m_rows_fn *to_rgb, struct error *err);
/* video_create's. */
struct video_writer *writer_create(const char *path,
                                   const struct video_options *opt,
                                   struct error *err);
/* video_write's. */
int writer_write(struct video_writer *v, const uint8_t *pixel, double time,
                 struct error *err);
/* video_finish's. */
int writer_finish(struct video_writer *v, double end, struct error *err);

/* Whether the end of the file is missing, by what its container says of its
 * length.  Moves the place that is read next. */
struct AVFormatContext;
struct AVStream;
bool video_is_cut(const struct AVFormatContext *file,
                  const struct AVStream *stream);

/* A clip's way to RGB. */
struct video_colours {
    bool bt601;                 /* whatever the file says */
    y4m_rows_fn *to_rgb;        /* the program's */
    struct SwsContext *swscale; /* for what is no planes of Y4M's */
};
/* rgb, `stride` bytes a row of 8 or 16 bits a value, from a frame: by to_rgb
 * where Y4M has a name for its planes, else by swscale.  NULL, or why not. */
struct AVFrame;
const char *video_to_rgb(uint8_t *rgb, size_t stride, int bits,
                         const struct AVFrame *f, struct video_colours *c);
void video_colours_release(struct video_colours *c);

/* What a container's crop rectangle leaves out on each side, pixels as
 * stored. */
struct video_crop {
    size_t left, right, top, bottom;
};
struct video_crop video_find_crop(struct AVFormatContext *file,
                                  const struct AVStream *stream);

/* n bytes of the file from `at` on; whether there are so many. */
struct AVIOContext;
bool video_bytes(struct AVIOContext *io, uint8_t *b, int n, int64_t at);
/* A number of EBML at *at, which moves behind it; name: with its marker, as
 * elements are called.  -1: none, or not known. */
int64_t video_ebml(struct AVIOContext *io, int64_t *at, bool name);

/* The sound of a clip on its way into a file that is written. */
struct sound;
/* Find the sound of the clip at path and give `file` a stream for it, before
 * its header is written.  start: time in the clip of the first picture.  NULL
 * where it has none, or none that can be carried. */
struct sound *sound_open(const char *path, double start,
                         struct AVFormatContext *file);
/* How much later than the file's beginning the first picture is, seconds: what
 * sounds before it. */
double sound_lead(const struct sound *s);
/* Write what sounds until so many seconds after the first picture (infinite:
 * all).  A libav error number; a fault of the clip's sound ends it. */
int sound_write(struct sound *s, double until);
void sound_close(struct sound *s);                /* NULL is allowed */

/* "file:" and the path, to be freed: a name with a colon is no address.  NULL
 * without memory. */
char *reader_url(const char *path);

/* What players take for BT.709 when the file does not say. */
static inline bool video_is_hd(int width, int height)
{
    return width >= 1280 || height > 576;
}

#endif
