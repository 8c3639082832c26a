/* Standard input and pipes, copied beside the files (kept.h). */
#include "lib/base/kept.h"

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>
#include <unistd.h>

#include "lib/base/file.h"

/* A file without a name, or -1. */
static int kept_make(struct error *err)
{
    char path[FILE_TEMPORARY];

    file_temporary(path, "spid-XXXXXX");
    const int fd = mkostemp(path, O_CLOEXEC);
    if (fd < 0)
        return error_set(err, EX_IOERR, "%s: cannot keep the input: %s", path,
                         strerror(errno));
    unlink(path);
    return fd;
}

/* All of `from`. */
static int kept_fill(int to, int from, size_t max, struct error *err)
{
    char block[1 << 16];
    size_t all = 0;

    for (;;) {
        const ssize_t n = read(from, block, sizeof block);

        if (n == 0)
            return 0;
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0)
            return error_set(err, EX_IOERR, "cannot be read: %s",
                             strerror(errno));
        all += (size_t)n;
        if (all > max)
            return error_set(err, EX_DATAERR, "more than %zu bytes", max);
        for (ssize_t done = 0, w; done < n; done += w) {
            w = write(to, block + done, (size_t)(n - done));
            if (w < 0 && errno != EINTR)
                return error_set(err, EX_IOERR, "cannot be kept in TMPDIR: %s",
                                 strerror(errno));
            w = w < 0 ? 0 : w;
        }
    }
}

const char *kept_open(struct kept *k, const char *path, size_t max,
                      struct error *err)
{
    const bool standard = strcmp(path, "-") == 0;
    struct stat st;
    int rc = -1;

    *k = (struct kept){.name = standard ? "<stdin>" : path};
    if (!standard && (stat(path, &st) || !S_ISFIFO(st.st_mode)))
        return path;
    const int from = standard ? STDIN_FILENO : open(path, O_RDONLY | O_CLOEXEC);
    if (from < 0)
        error_set(err, EX_NOINPUT, "cannot open: %s", strerror(errno));
    else if (isatty(from))
        error_set(err, EX_USAGE, "a terminal (expected a file or a pipe)");
    else if ((k->fd = kept_make(err)) > 0)
        rc = kept_fill(k->fd, from, max, err);
    if (from > STDIN_FILENO)
        close(from);
    snprintf(k->path, sizeof k->path, "/dev/fd/%d", k->fd);
    if (rc == 0)
        return k->path;
    kept_close(k, rc, err);
    error_prefix(err, "%s", k->name);
    return NULL;
}

int kept_close(struct kept *k, int rc, struct error *err)
{
    const size_t n = strlen(k->path);
    const char *rest = err->text + n;

    if (k->fd > 0)
        close(k->fd);
    if (rc && k->fd > 0 && strncmp(err->text, k->path, n) == 0 &&
        strncmp(rest, ": ", 2) == 0) {
        memmove(err->text, rest + 2, strlen(rest + 2) + 1);
        error_prefix(err, "%s", k->name);
    }
    k->fd = 0;
    return rc;
}
