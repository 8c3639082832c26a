/* Modules: found and loaded once each (module.h). */
#include "formats/module.h"

#include <dlfcn.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sysexits.h>
#include <unistd.h>

#include "lib/base/file.h"

struct module {
    const char *file, *symbol, *what;
    pthread_mutex_t lock;
    const void *table;
    pthread_t thread;           /* that loads it ahead of time */
};

static struct module module_pictures = {
    .file = "media.so", .symbol = "spid_media", .what = "pictures and cameras",
    .lock = PTHREAD_MUTEX_INITIALIZER
};
static struct module module_videos = {
    .file = "video.so", .symbol = "spid_video", .what = "videos",
    .lock = PTHREAD_MUTEX_INITIALIZER
};
static struct module module_filters = {
    .file = "filter.so", .symbol = "spid_filter", .what = "filters of videos",
    .lock = PTHREAD_MUTEX_INITIALIZER
};

static struct module module_https = {
    .file = "http.so", .symbol = "spid_http", .what = "HTTP",
    .lock = PTHREAD_MUTEX_INITIALIZER
};

/* The table of the module in a folder, or NULL. */
static const void *module_try(const struct module *m, const char *folder)
{
    char path[4200];
    void *module;

    snprintf(path, sizeof path, "%s/%s", folder, m->file);
    if (access(path, R_OK))
        return NULL;
    module = dlopen(path, RTLD_LAZY | RTLD_LOCAL);
    return module ? dlsym(module, m->symbol) : NULL;
}

/* Beside the folder of the program, or of a test's. */
static const void *module_beside(const struct module *m)
{
    static const char *const place[] = {
        "../lib/spid", "../../lib/spid", "."
    };
    char own[2048], folder[2100];
    const bool known = file_own_folder(own, sizeof own);
    const void *table = NULL;

    for (size_t i = 0; known && !table && i < sizeof place / sizeof *place;
         i++) {
        snprintf(folder, sizeof folder, "%s%s", own, place[i]);
        table = module_try(m, folder);
    }
    return table;
}

/* Once, whoever asks first; a failure is tried again at the next call. */
static const void *module_load(struct module *m, struct error *err)
{
    const char *own = getenv("SPID_MODULES");

    pthread_mutex_lock(&m->lock);
    dlerror();                  /* forgets what others failed to load */
    if (!m->table)
        m->table = own ? module_try(m, own) : module_beside(m);
    const void *table = m->table;
    if (!table) {
        const char *why = dlerror();

        error_set(err, EX_UNAVAILABLE, "cannot load the module of %s: %s "
                  "(expected lib/spid/%s beside the program's folder, or in "
                  "$SPID_MODULES)", m->what, why ? why : "it is not there",
                  m->file);
    }
    pthread_mutex_unlock(&m->lock);
    return table;
}

const struct media_module *module_media(struct error *err)
{
    return module_load(&module_pictures, err);
}

const struct video_module *module_video(struct error *err)
{
    return module_load(&module_videos, err);
}

const struct filter_module *module_filter(void)
{
    return module_load(&module_filters, NULL);
}

const struct http_module *module_http(struct error *err)
{
    return module_load(&module_https, err);
}

/* ---- ahead of time ------------------------------------------------------- */

/* The module that a file of this name wants, or NULL. */
static struct module *module_of(const char *path)
{
    static const char *const none[] = {
        "png", "jpg", "jpeg", "ppm", "pgm", "pnm", "pam", "y4m", "spid"
    };
    static const char *const picture[] = {
        "tif", "tiff", "bmp", "webp", "exr", "tga", "hdr", "jp2", "heic",
        "heif", "avif", "psd", "dpx"
    };
    const char *dot = path ? strrchr(path, '.') : NULL;

    if (!path || !strcmp(path, "-"))
        return NULL;
    if (video_is_live(path))
        return video_is_camera(path) ? &module_pictures : &module_videos;
    if (!dot || strchr(dot, '/') || !strncmp(path, "/dev/", 5))
        return NULL;
    for (size_t i = 0; i < sizeof none / sizeof *none; i++)
        if (!strcasecmp(dot + 1, none[i]))
            return NULL;
    for (size_t i = 0; i < sizeof picture / sizeof *picture; i++)
        if (!strcasecmp(dot + 1, picture[i]))
            return &module_pictures;
    return &module_videos;
}

static void *module_run(void *module)
{
    module_load(module, NULL);
    return NULL;
}

/* The libraries' ends must not run while they still begin.  Called once for each
 * time that modules were loaded ahead. */
static void module_wait(void)
{
    struct module *const each[] = {&module_pictures, &module_videos};

    for (size_t i = 0; i < sizeof each / sizeof *each; i++) {
        if (each[i]->thread)
            pthread_join(each[i]->thread, NULL);
        each[i]->thread = 0;
    }
}

void module_preload(const char *const paths[], size_t count)
{
    bool any = false;

    for (size_t i = 0; i < count; i++) {
        struct module *m = module_of(paths[i]);

        if (!m || m->thread)
            continue;
        if (pthread_create(&m->thread, NULL, module_run, m))
            m->thread = 0;
        else
            any = true;
    }
    if (any)
        atexit(module_wait);
}
