/* Pictures and videos of every format by OpenImageIO, OpenCV and ffmpeg, which
 * bring 250 shared libraries along: a quarter of a second for every program
 * that links them.  They are a module of their own, media.so, loaded when the
 * first such file is opened. */
#ifndef SPID_FORMATS_MEDIA_H
#define SPID_FORMATS_MEDIA_H

#include "formats/image.h"
#include "formats/panorama.h"
#include "formats/video.h"

/* The module's functions: those of the headers above, but for PNG
 * (formats/png.h) and marks, which are the program's. */
struct media {
    int (*image_read)(struct image *im, const char *path, struct error *err);
    int (*exr_write)(const char *path, const float *pixel, size_t width,
                     size_t height, int channels, const char *const *names,
                     const char *mark, struct error *err);
    int (*panorama_read)(struct panorama *p, const char *path,
                         struct error *err);
    struct video_reader *(*video_open)(const char *path, bool bt601,
                                       struct error *err);
    double (*video_rate)(const struct video_reader *v);
    size_t (*video_frames)(const struct video_reader *v);
    bool (*video_cut)(const struct video_reader *v);
    int (*video_read)(struct video_reader *v, const uint8_t **rgb,
                      size_t *width, size_t *height, double *time,
                      struct error *err);
    void (*video_close)(struct video_reader *v);
    struct video_writer *(*video_create)(const char *path, size_t width,
                                         size_t height, double rate,
                                         struct error *err);
    int (*video_write)(struct video_writer *v, const uint8_t *rgb,
                       struct error *err);
    int (*video_finish)(struct video_writer *v, struct error *err);
    void (*video_abandon)(struct video_writer *v);
};

/* The module: $SPID_MEDIA, or lib/spid/media.so beside the program's folder.
 * NULL and EX_UNAVAILABLE when it cannot be loaded.  From any thread. */
const struct media *media_load(struct error *err);

/* Start to load it in another thread if these files (NULL: none) are of a
 * format that needs it; whoever needs it first waits.  At exit, too. */
void media_preload(const char *const paths[], size_t count);

#endif
