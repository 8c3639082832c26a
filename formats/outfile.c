/* Output files: written as PATH.part, renamed when complete. */
#include "formats/outfile.h"

#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#include "lib/base/file.h"

/* Names only; the file is closed. */
static void outfile_release(struct outfile *o)
{
    free(o->path);
    free(o->part);
    memset(o, 0, sizeof *o);
}

/* Standard output, or PATH.part. */
static int outfile_begin(struct outfile *o, const char *path, bool standard,
                         struct error *err)
{
    size_t n = strlen(path) + 6;

    memset(o, 0, sizeof *o);
    o->path = strdup(standard ? "<stdout>" : path);
    if (!o->path)
        return error_set(err, EX_OSERR, "%s: out of memory", path);
    if (standard) {
        o->file = stdout;
    } else if (file_is_special(path)) { /* device or fifo: written in place */
        o->file = fopen(path, "wb");
    } else if ((o->part = malloc(n))) {
        snprintf(o->part, n, "%s.part", path);
        o->file = fopen(o->part, "wb");
    }
    if (o->file)
        return 0;
    error_set(err, EX_CANTCREAT, "%s: %s", path, strerror(errno));
    outfile_release(o);
    return -1;
}

int outfile_open(struct outfile *o, const char *path, struct error *err)
{
    const bool standard = !strcmp(path, "-");

    if (!standard || !isatty(STDOUT_FILENO))
        return outfile_begin(o, path, standard, err);
    memset(o, 0, sizeof *o);
    return error_set(err, EX_USAGE, "<stdout>: refusing to write binary data to "
                     "a terminal (use -o FILE or a pipe)");
}

int outfile_open_text(struct outfile *o, const char *path, struct error *err)
{
    return outfile_begin(o, path, !strcmp(path, "-"), err);
}

int outfile_close(struct outfile *o, struct error *err)
{
    bool bad = fflush(o->file) || ferror(o->file);
    int why = errno, rc = 0;

    if (o->file != stdout && fclose(o->file) && !bad) {
        bad = 1;
        why = errno;
    }
    if (o->part && !bad && file_rename(o->part, o->path)) {
        bad = 1;
        why = errno;
    }
    if (o->part && bad)
        remove(o->part);
    if (bad)
        rc = error_set(err, EX_IOERR, "%s: %s", o->path, strerror(why));
    outfile_release(o);
    return rc;
}

void outfile_abandon(struct outfile *o)
{
    if (o->file && o->file != stdout)
        fclose(o->file);
    if (o->part)
        remove(o->part);
    outfile_release(o);
}

int outfile_error(const struct outfile *o, struct error *err)
{
    return error_set(err, EX_IOERR, "%s: cannot write: %s", o->path,
                     strerror(errno ? errno : EIO));
}
