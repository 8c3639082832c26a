/* Names of inputs, spelled out (inputs.h). */
#include "formats/inputs.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <sysexits.h>
#include <unistd.h>

#include "formats/pattern.h"
#include "formats/video.h"
#include "lib/base/file.h"
#include "lib/base/list.h"

/* Append one input. */
static int inputs_add_path(struct inputs *s, const char *path,
                                struct error *err)
{
    char **p = list_grow(s->path, &s->room, s->count, sizeof *p);

    if (!p)
        return error_set(err, EX_OSERR, "out of memory");
    s->path = p;
    s->path[s->count] = strdup(path);
    if (!s->path[s->count])
        return error_set(err, EX_OSERR, "out of memory");
    s->count++;
    return 0;
}

/* By its ending; hidden files are none. */
bool inputs_is_picture(const char *name)
{
    static const char *const end[] = {
        "png", "jpg", "jpeg", "tif", "tiff", "bmp", "webp", "exr", "ppm",
        "pgm", "pam", "pnm", "tga", "hdr", "jp2", "gif", "heic", "heif",
        "avif", "psd", "dpx"
    };
    const char *dot = strrchr(name, '.');

    if (!dot || name[0] == '.')
        return false;
    for (size_t i = 0; i < sizeof end / sizeof *end; i++)
        if (strcasecmp(dot + 1, end[i]) == 0)
            return true;
    return false;
}

/* For scandir. */
static int inputs_filter(const struct dirent *e)
{
    return inputs_is_picture(e->d_name);
}

/* The pictures of a folder as a person counts them: 2 before 10. */
static int inputs_add_folder(struct inputs *s, const char *path,
                                  struct error *err)
{
    struct dirent **entry;
    int n = scandir(path, &entry, inputs_filter, versionsort),
        rc = 0;

    if (n < 0)
        return error_set(err, EX_NOINPUT, "%s: cannot open: %s", path,
                         strerror(errno));
    if (n == 0)
        rc = error_set(err, EX_DATAERR, "%s: no pictures in this directory "
                       "(expected names such as 0001.png)", path);
    for (int i = 0; i < n; i++) {
        size_t size = strlen(path) + strlen(entry[i]->d_name) + 2;
        char *full = malloc(size);

        if (!full)
            rc = error_set(err, EX_OSERR, "out of memory");
        if (rc == 0) {
            snprintf(full, size, "%s/%s", path, entry[i]->d_name);
            rc = inputs_add_path(s, full, err);
        }
        free(full);
        free(entry[i]);
    }
    free(entry);
    return rc;
}

/* The lines of a file, one input each. */
static int inputs_add_list(struct inputs *s, const char *path,
                                struct error *err)
{
    FILE *fp = fopen(path, "r");
    char *line = NULL;
    size_t size = 0;
    ssize_t n;
    int rc = 0;

    if (!fp)
        return error_set(err, EX_NOINPUT, "%s: cannot open: %s", path,
                         strerror(errno));
    while (rc == 0 && (n = getline(&line, &size, fp)) >= 0) {
        while (n > 0 && (line[n - 1] == '\n' || line[n - 1] == '\r'))
            line[--n] = 0;
        if (n > 0)
            rc = inputs_add_path(s, line, err);
    }
    free(line);
    fclose(fp);
    return rc;
}

/* The pictures of a pattern such as frames/%05d.png, none missing. */
static int inputs_add_pattern(struct inputs *s, const char *path,
                                   struct error *err)
{
    uint64_t first, last;
    int rc = pattern_find(path, &first, &last, err);

    for (uint64_t n = first; rc == 0 && n <= last; n++) {
        char *name = pattern_name(path, n);

        rc = name ? inputs_add_path(s, name, err)
                  : error_set(err, EX_OSERR, "out of memory");
        free(name);
    }
    return rc;
}

/* A list, a folder, a pattern or the thing itself. */
int inputs_add(struct inputs *s, const char *path,
                                 struct error *err)
{
    struct stat st;

    if (path[0] == '@')
        return inputs_add_list(s, path + 1, err);
    if (strcmp(path, "-") != 0 && !video_is_live(path)
        && stat(path, &st) == 0 && S_ISDIR(st.st_mode))
        return inputs_add_folder(s, path, err);
    if (!video_is_live(path) && pattern_count(path) == 1 &&
        access(path, F_OK) != 0)
        return inputs_add_pattern(s, path, err);
    return inputs_add_path(s, path, err);
}

bool inputs_have(const struct inputs *s, const char *name)
{
    const bool pattern = pattern_count(name) == 1;

    for (size_t i = 0; i < (pattern ? s->count : 1); i++) {
        char *one = pattern ? pattern_name(name, i) : NULL;
        bool same = false;

        for (size_t k = 0; k < s->count && !same; k++)
            same = file_is_same(one ? one : name, s->path[k]);
        free(one);
        if (same)
            return true;
    }
    return false;
}

void inputs_release(struct inputs *s)
{
    for (size_t i = 0; i < s->count; i++)
        free(s->path[i]);
    free(s->path);
    *s = (struct inputs){0};
}
