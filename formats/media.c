/* The module of pictures and videos: found, loaded once, and its functions
 * under the names that formats/image.h, exr.h, panorama.h and video.h
 * promise. */
#include "formats/media.h"

#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#include "formats/exr.h"
#include "formats/mark.h"
#include "formats/png.h"
#include "lib/base/file.h"

/* ---- loading ----------------------------------------------------------- */

static pthread_mutex_t media_lock = PTHREAD_MUTEX_INITIALIZER;
static const struct media *media_table;
static pthread_t media_thread;

/* The module at path, or NULL. */
static const struct media *media_try(const char *path)
{
    void *module = dlopen(path, RTLD_LAZY | RTLD_LOCAL);

    return module ? dlsym(module, "spid_media") : NULL;
}

/* Beside the folder of the program, or of a test's. */
static const struct media *media_beside(void)
{
    static const char *const place[] = {
        "../lib/spid/media.so", "../../lib/spid/media.so", "media.so"
    };
    char exe[2048], path[2100];
    ssize_t n = readlink("/proc/self/exe", exe, sizeof exe - 1);
    char *slash = n > 0 ? (exe[n] = 0, strrchr(exe, '/')) : NULL;

    for (size_t i = 0; slash && i < sizeof place / sizeof *place; i++) {
        slash[1] = 0;
        snprintf(path, sizeof path, "%s%s", exe, place[i]);
        if (access(path, R_OK) == 0)
            return media_try(path);
    }
    return NULL;
}

const struct media *media_load(struct error *err)
{
    const char *own = getenv("SPID_MEDIA");

    pthread_mutex_lock(&media_lock);
    if (!media_table)
        media_table = own ? media_try(own) : media_beside();
    if (!media_table) {
        const char *why = dlerror();

        error_set(err, EX_UNAVAILABLE, "cannot load the module of pictures "
                  "and videos: %s (expected lib/spid/media.so beside the "
                  "program's folder, or $SPID_MEDIA)",
                  why ? why : "it is not there");
    }
    pthread_mutex_unlock(&media_lock);
    return media_table;
}

/* ---- ahead of time ----------------------------------------------------- */

/* Whether the module reads or writes what is called so. */
static bool media_is(const char *path)
{
    static const char *const own[] = {
        ".png", ".ppm", ".pgm", ".pam", ".y4m", ".spid"
    };

    if (!path || !strcmp(path, "-") ||
        (!strncmp(path, "/dev/", 5) && !video_is_camera(path)))
        return false;
    for (size_t i = 0; i < sizeof own / sizeof *own; i++)
        if (file_ends(path, own[i]))
            return false;
    return true;
}

static void *media_run(void *unused)
{
    media_load(NULL);
    return unused;
}

/* The libraries' ends must not run while they still begin. */
static void media_wait(void)
{
    pthread_join(media_thread, NULL);
}

void media_preload(const char *const paths[], size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (media_is(paths[i])) {
            if (!pthread_create(&media_thread, NULL, media_run, NULL))
                atexit(media_wait);
            return;
        }
}

/* ---- the functions ----------------------------------------------------- */

/* PNG is read as from pipes. */
static int image_read_png(struct image *im, FILE *fp, const char *path,
                          struct error *err)
{
    rewind(fp);
    return png_read_next(fp, &im->rgb, &im->alpha, &im->width, &im->height,
                         IMAGE_MAX_PIXELS, err)
               ? error_prefix(err, "%s", path) : 0;
}

int image_read(struct image *im, const char *path, struct error *err)
{
    FILE *fp = fopen(path, "rb");
    const struct media *m;
    int rc;

    memset(im, 0, sizeof *im);
    if (!fp)
        return error_set(err, EX_NOINPUT, "%s: cannot open: %s", path,
                         strerror(errno));
    if (getc(fp) == 0x89) {
        rc = image_read_png(im, fp, path, err);
        fclose(fp);
        return rc;
    }
    fclose(fp);
    m = media_load(err);
    return m ? m->image_read(im, path, err) : error_prefix(err, "%s", path);
}

void image_release(struct image *im)
{
    free(im->rgb);
    free(im->alpha);
    memset(im, 0, sizeof *im);
}

int exr_write(const char *path, const float *pixel, size_t width,
              size_t height, int channels, const char *const *names,
              struct error *err)
{
    const struct media *m = media_load(err);

    return m ? m->exr_write(path, pixel, width, height, channels, names,
                            mark_text(), err)
             : error_prefix(err, "%s", path);
}

int panorama_read(struct panorama *p, const char *path, struct error *err)
{
    const struct media *m = media_load(err);

    memset(p, 0, sizeof *p);
    return m ? m->panorama_read(p, path, err) : error_prefix(err, "%s", path);
}

void panorama_release(struct panorama *p)
{
    free(p->rgb);
    memset(p, 0, sizeof *p);
}

struct video_reader *video_open(const char *path, bool bt601,
                                struct error *err)
{
    const struct media *m = media_load(err);

    return m ? m->video_open(path, bt601, err)
             : (error_prefix(err, "%s", path), NULL);
}

struct video_writer *video_create(const char *path, size_t width,
                                  size_t height, double rate,
                                  struct error *err)
{
    const struct media *m = media_load(err);

    return m ? m->video_create(path, width, height, rate, err)
             : (error_prefix(err, "%s", path), NULL);
}

/* Whoever has a reader or a writer has the module. */

double video_rate(const struct video_reader *v)
{
    return media_table->video_rate(v);
}

size_t video_frames(const struct video_reader *v)
{
    return media_table->video_frames(v);
}

bool video_cut(const struct video_reader *v)
{
    return media_table->video_cut(v);
}

int video_read(struct video_reader *v, const uint8_t **rgb, size_t *width,
               size_t *height, double *time, struct error *err)
{
    return media_table->video_read(v, rgb, width, height, time, err);
}

void video_close(struct video_reader *v)
{
    if (v)
        media_table->video_close(v);
}

int video_write(struct video_writer *v, const uint8_t *rgb, struct error *err)
{
    return media_table->video_write(v, rgb, err);
}

int video_finish(struct video_writer *v, struct error *err)
{
    return media_table->video_finish(v, err);
}

void video_abandon(struct video_writer *v)
{
    if (v)
        media_table->video_abandon(v);
}
