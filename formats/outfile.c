#include "formats/outfile.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

static void release(struct outfile *o)
{
    free(o->path);
    free(o->part);
    memset(o, 0, sizeof *o);
}

int outfile_open(struct outfile *o, const char *path, struct error *err)
{
    size_t n = strlen(path) + 6;

    memset(o, 0, sizeof *o);
    o->path = strdup(path);
    if (!o->path)
        return error_set(err, EX_OSERR, "%s: out of memory", path);
    if (!strcmp(path, "-")) {
        if (isatty(STDOUT_FILENO)) {
            release(o);
            return error_set(err, EX_USAGE, "<stdout>: refusing to write "
                             "binary data to a terminal (use -o FILE or a "
                             "pipe)");
        }
        o->file = stdout;
        return 0;
    }
    o->part = malloc(n);
    if (o->part) {
        snprintf(o->part, n, "%s.part", path);
        o->file = fopen(o->part, "wb");
    }
    if (o->file)
        return 0;
    error_set(err, EX_CANTCREAT, "%s: %s", path, strerror(errno));
    release(o);
    return -1;
}

int outfile_close(struct outfile *o, struct error *err)
{
    int bad = fflush(o->file) || ferror(o->file);
    int why = errno, rc = 0;

    if (o->part) {
        if (fclose(o->file) && !bad) {
            bad = 1;
            why = errno;
        }
        if (!bad && rename(o->part, o->path)) {
            bad = 1;
            why = errno;
        }
        if (bad)
            remove(o->part);
    }
    if (bad)
        rc = error_set(err, EX_IOERR, "%s: %s", o->path, strerror(why));
    release(o);
    return rc;
}

void outfile_abandon(struct outfile *o)
{
    if (o->part) {
        fclose(o->file);
        remove(o->part);
    }
    release(o);
}

int outfile_error(const struct outfile *o, struct error *err)
{
    return error_set(err, EX_IOERR, "%s: cannot write: %s", o->path,
                     strerror(errno ? errno : EIO));
}
