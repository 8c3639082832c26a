/* Videos by the module of each: under the names that formats/video.h
 * promises. */
#include "formats/video.h"

#include "formats/module.h"

struct video_reader *video_open(const char *path, bool bt601,
                                struct error *err)
{
    if (video_is_live(path)) {
        const struct media_module *m = module_media(err);

        return m ? m->camera_open(path, err)
                 : (error_prefix(err, "%s", path), NULL);
    }
    const struct video_module *m = module_video(err);

    return m ? m->open(path, bt601, err)
             : (error_prefix(err, "%s", path), NULL);
}

double video_rate(const struct video_reader *v)
{
    return v->by->rate(v);
}

size_t video_frames(const struct video_reader *v)
{
    return v->by->frames(v);
}

double video_end(const struct video_reader *v)
{
    return v->by->end(v);
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

struct video_writer *video_create(const char *path, size_t width,
                                  size_t height, double rate,
                                  struct error *err)
{
    const struct video_module *m = module_video(err);

    return m ? m->create(path, width, height, rate, err)
             : (error_prefix(err, "%s", path), NULL);
}

/* Whoever has a writer has the module. */

int video_write(struct video_writer *v, const uint8_t *rgb, double time,
                struct error *err)
{
    return module_video(NULL)->write(v, rgb, time, err);
}

int video_finish(struct video_writer *v, struct error *err)
{
    return module_video(NULL)->finish(v, err);
}

void video_abandon(struct video_writer *v)
{
    if (v)
        module_video(NULL)->abandon(v);
}
