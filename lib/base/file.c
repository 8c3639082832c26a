/* Files that take their final name when complete. */
#include "lib/base/file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sysexits.h>
#include <unistd.h>

bool file_is_special(const char *path)
{
    struct stat st;

    return stat(path, &st) == 0 && !S_ISREG(st.st_mode);
}

bool file_ends(const char *name, const char *ending)
{
    size_t n = strlen(name), m = strlen(ending);

    return n > m && strcasecmp(name + n - m, ending) == 0;
}

bool file_is_same(const char *a, const char *b)
{
    struct stat p, q;

    return stat(a, &p) == 0 && stat(b, &q) == 0 && S_ISREG(p.st_mode) &&
           p.st_dev == q.st_dev && p.st_ino == q.st_ino;
}

bool file_is_media_name(const char *name)
{
    static const char *const ending[] = {
        ".png", ".apng", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp",
        ".gif", ".exr", ".ppm", ".pgm", ".pam", ".pnm", ".tga", ".hdr", ".jp2",
        ".jxl", ".heic", ".heif", ".avif", ".psd", ".dpx", ".svg", ".pdf",
        ".y4m", ".mp4", ".m4v", ".mov", ".mkv", ".webm", ".avi", ".wmv", ".flv",
        ".ts", ".mts", ".m2ts", ".mpg", ".mpeg", ".3gp", ".ogv", ".mp3", ".wav",
        ".m4a", ".aac", ".flac", ".ogg", ".opus"
    };

    for (size_t i = 0; i < sizeof ending / sizeof *ending; i++)
        if (file_ends(name, ending[i]))
            return true;
    return false;
}

int file_rename(const char *part, const char *path)
{
    if (file_is_special(path)) {
        errno = EEXIST;
        return -1;
    }
    return rename(part, path);
}

/* All of f, ended by a 0, in room that grows with what there is; *n bytes. */
static char *file_read_all(FILE *f, size_t *n, size_t max, struct error *err)
{
    size_t room = 0;
    char *text = NULL;
    struct stat st;

    if (!fstat(fileno(f), &st) && S_ISREG(st.st_mode) &&
        (size_t)st.st_size > max)
        return error_null(err, EX_DATAERR, "more than %zu bytes", max);
    for (*n = 0;;) {
        if (*n == room) {
            char *more = realloc(text, (room = 2 * room + 4096) + 1);

            if (!more) {
                error_set(err, EX_OSERR, "no memory for %zu bytes", room);
                break;
            }
            text = more;
        }
        const size_t got = fread(text + *n, 1, room - *n, f);
        *n += got;
        if (*n > max) {
            error_set(err, EX_DATAERR, "more than %zu bytes", max);
            break;
        }
        if (ferror(f)) {
            error_set(err, EX_IOERR, "cannot be read: %s", strerror(errno));
            break;
        }
        if (got == 0) {
            text[*n] = 0;
            return text;
        }
    }
    free(text);
    return NULL;
}

char *file_read(size_t *bytes, const char *path, size_t max, struct error *err)
{
    FILE *f = strcmp(path, "-") ? fopen(path, "rb") : stdin;
    char *data;

    if (!f)
        return error_null(err, EX_NOINPUT, "%s: %s", path, strerror(errno));
    data = file_read_all(f, bytes, max, err);
    if (!data)
        error_prefix(err, "%s", path);
    if (f != stdin)
        fclose(f);
    return data;
}

char *file_read_text(const char *path, size_t max, struct error *err)
{
    size_t n;
    char *text = file_read(&n, path, max, err);

    if (!text || strlen(text) == n)
        return text;
    free(text);
    return error_null(err, EX_DATAERR, "%s: not a text file", path);
}

void *file_map(size_t *bytes, const char *path, struct error *err)
{
    const int fd = open(path, O_RDONLY | O_CLOEXEC);
    struct stat st;
    void *map;

    if (fd < 0)
        return error_null(err, errno == EACCES ? EX_NOPERM : EX_NOINPUT,
                          "%s: %s", path, strerror(errno));
    if (fstat(fd, &st) || !S_ISREG(st.st_mode)) {
        close(fd);
        return error_null(err, EX_NOINPUT, "%s: not a regular file", path);
    }
    *bytes = (size_t)st.st_size;
    map = *bytes ? mmap(NULL, *bytes, PROT_READ, MAP_PRIVATE, fd, 0)
                 : MAP_FAILED;
    close(fd);
    if (map != MAP_FAILED)
        return map;
    if (*bytes)
        return error_null(err, EX_OSERR, "%s: %s", path, strerror(errno));
    return error_null(err, EX_DATAERR, "%s: empty", path);
}

void file_temporary(char *path, const char *name)
{
    const char *dir = getenv("TMPDIR");
    const bool fits = dir && *dir &&
                      strlen(dir) + strlen(name) + 2 <= FILE_TEMPORARY;

    snprintf(path, FILE_TEMPORARY, "%s/%s", fits ? dir : "/tmp", name);
}

bool file_own_folder(char *folder, size_t size)
{
    const ssize_t n = readlink("/proc/self/exe", folder, size - 1);

    folder[n > 0 ? n : 0] = 0;
    char *slash = strrchr(folder, '/');

    folder[slash ? slash + 1 - folder : 0] = 0;
    return slash != NULL;
}
