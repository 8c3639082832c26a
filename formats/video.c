/* Videos by the module of each: under the names that formats/video.h
 * promises. */
#include "formats/video.h"

#include <stdio.h>

#include "formats/module.h"

/* Whether the file is an animation of WebP, which is the other module's. */
static bool video_file_is_webp(const char *path)
{
    uint8_t b[32];
    FILE *f = fopen(path, "rb");
    const size_t n = f ? fread(b, 1, sizeof b, f) : 0;

    if (f)
        fclose(f);
    return video_is_webp(b, n);
}

struct video_reader *video_open(const char *path, bool bt601,
                                struct error *err)
{
    const bool camera = video_is_camera(path);

    if (camera || video_file_is_webp(path)) {
        const struct media_module *m = module_media(err);

        if (m)
            return camera ? m->camera_open(path, err)
                          : m->webp_open(path, err);
    } else {
        const struct video_module *m = module_video(err);

        if (m)
            return m->open(path, bt601, y4m_rows_to_rgb, err);
    }
    error_prefix(err, "%s", path);
    return NULL;
}

int video_read(struct video_reader *v, const uint8_t **rgb, size_t *width,
               size_t *height, double *time, struct error *err)
{
    return v->by->read(v, rgb, width, height, time, err);
}

void video_close(struct video_reader *v)
{
    if (v)
        v->by->close(v);
}

struct video_writer *video_create(const char *path,
                                  const struct video_options *opt,
                                  struct error *err)
{
    const struct video_module *m = module_video(err);

    return m ? m->create(path, opt, err)
             : (error_prefix(err, "%s", path), NULL);
}

/* Whoever has a writer has the module. */

int video_write(struct video_writer *v, const uint8_t *pixel, double time,
                struct error *err)
{
    return module_video(NULL)->write(v, pixel, time, err);
}

int video_finish(struct video_writer *v, double end, struct error *err)
{
    return module_video(NULL)->finish(v, end, err);
}
