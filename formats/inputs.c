/* Names of inputs, spelled out (inputs.h). */
#include "formats/inputs.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <sysexits.h>
#include <unistd.h>

#include "formats/pattern.h"
#include "formats/video.h"
#include "lib/base/file.h"

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

/* The pictures of a pattern such as frames/%05d.png, none missing. */
static int inputs_add_pattern(struct names *s, const char *path,
                              struct error *err)
{
    uint64_t first, last;
    int rc = pattern_find(path, &first, &last, err);

    for (uint64_t n = first; rc == 0 && n <= last; n++) {
        char *name = pattern_name(path, n);

        rc = name ? names_add(s, name, err)
                  : error_set(err, EX_OSERR, "out of memory");
        free(name);
    }
    return rc;
}

/* A list, a folder, a pattern or the thing itself. */
int inputs_add(struct names *s, const char *path, struct error *err)
{
    struct stat st;
    int found;

    if (path[0] == '@')
        return names_add_lines(s, path + 1, err);
    if (strcmp(path, "-") != 0 && !video_is_live(path)
        && stat(path, &st) == 0 && S_ISDIR(st.st_mode)) {
        found = names_add_folder(s, path, inputs_is_picture, err);
        return found ? found > 0 ? 0 : -1
               : error_set(err, EX_DATAERR, "%s: no pictures in this directory "
                           "(expected names such as 0001.png)", path);
    }
    if (!video_is_live(path) && pattern_count(path) == 1 &&
        access(path, F_OK) != 0)
        return inputs_add_pattern(s, path, err);
    return names_add(s, path, err);
}

bool inputs_have(const struct names *s, const char *name)
{
    const bool pattern = pattern_count(name) == 1;

    for (size_t i = 0; i < (pattern ? s->count : 1); i++) {
        char *one = pattern ? pattern_name(name, i) : NULL;
        bool same = false;

        for (size_t k = 0; k < s->count && !same; k++)
            same = file_is_same(one ? one : name, s->name[k]);
        free(one);
        if (same)
            return true;
    }
    return false;
}
