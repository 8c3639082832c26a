/* Modules: parts that bring many shared libraries along, which would cost
 * every program that links them a tenth of a second and more.  They lie in
 * lib/spid beside the programs' folder, or in $SPID_MODULES, and are loaded
 * when the first file that wants one is opened. */
#ifndef SPID_FORMATS_MODULE_H
#define SPID_FORMATS_MODULE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "formats/image.h"
#include "formats/panorama.h"
#include "formats/video.h"
#include "formats/y4m.h"

/* What reads videos: the functions of the module that a reader is of. */
struct video_reading {
    int (*read)(struct video_reader *v, const uint8_t **rgb, size_t *width,
                size_t *height, double *time, struct error *err);
    void (*close)(struct video_reader *v);
};

/* media.so, with OpenImageIO, libheif, libwebp and OpenCV: pictures but for PNG
 * and JPEG (formats/png.h, jpeg.h), animations of WebP, and cameras. */
struct media_module {
    int (*image_read)(struct image *im, const char *path, struct error *err);
    int (*exr_write)(const char *path, const float *pixel, size_t width,
                     size_t height, int channels, const char *const *names,
                     const char *mark, struct error *err);
    int (*panorama_read)(struct panorama *p, const char *path,
                         struct error *err);
    struct video_reader *(*webp_open)(const char *path, struct error *err);
    struct video_reader *(*camera_open)(const char *path, struct error *err);
};

/* video.so, with ffmpeg's libraries: video files in and out, addresses in.
 * Planes that Y4M has a name for become colours by the program's to_rgb
 * (y4m_rows_to_rgb). */
struct video_module {
    struct video_reader *(*open)(const char *path, bool bt601,
                                 y4m_rows_fn *to_rgb, struct error *err);
    struct video_writer *(*create)(const char *path,
                                   const struct video_options *opt,
                                   struct error *err);
    int (*write)(struct video_writer *v, const uint8_t *pixel, double time,
                 struct error *err);
    int (*finish)(struct video_writer *v, double end, struct error *err);
};

struct AVFrame;
struct filter;

/* filter.so, with ffmpeg's filters, which bring eighty libraries along: for
 * video.so, where a clip is interlaced or an animation wants a palette.  Frames
 * in and out of the graph that a text describes, as ffmpeg's -vf. */
struct filter_module {
    /* For frames like this one; times in seconds num/den.  NULL when it cannot
     * be. */
    struct filter *(*open)(const char *graph, const struct AVFrame *like,
                           int num, int den);
    /* One more frame (its reference is taken over), NULL: the end; a libav
     * error number. */
    int (*send)(struct filter *f, struct AVFrame *frame);
    /* What is ready, times as given; AVERROR(EAGAIN), AVERROR_EOF. */
    int (*receive)(struct filter *f, struct AVFrame *frame);
    void (*close)(struct filter *f);        /* NULL is allowed */
};

struct http_server;
struct sockaddr_in;

/* http.so, with libmicrohttpd: pictures for browsers (formats/httpsink.h). */
struct http_module {
    struct http_server *(*open)(const struct sockaddr_in *at, bool anyone,
                                struct error *err);
    int (*write)(struct http_server *s, const uint8_t *rgb, size_t width,
                 size_t height, const char *mark, struct error *err);
    void (*close)(struct http_server *s);
};

/* The modules' tables; NULL and EX_UNAVAILABLE when one cannot be loaded.
 * From any thread. */
const struct media_module *module_media(struct error *err);
/* The same of videos. */
const struct video_module *module_video(struct error *err);
/* The same of filters; NULL where there is none. */
const struct filter_module *module_filter(void);
/* The same of HTTP. */
const struct http_module *module_http(struct error *err);

/* Start to load what these files (NULL: none) want by their names, in another
 * thread; whoever needs it first waits.  At exit, too. */
void module_preload(const char *const paths[], size_t count);

#endif
