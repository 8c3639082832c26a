/* A file that takes its name only when it is complete. */
#ifndef SPID_FORMATS_OUTFILE_H
#define SPID_FORMATS_OUTFILE_H

#include <stdio.h>

#include "lib/base/error.h"

struct outfile {
    FILE *file;
    char *path, *part;      /* part NULL: written in place */
};

/* Open PATH.part for writing ("-": standard output, refused when it is a
 * terminal). */
int outfile_open(struct outfile *o, const char *path, struct error *err);
/* The same of what people read: a terminal may have it. */
int outfile_open_text(struct outfile *o, const char *path, struct error *err);
/* Flush, close and rename; every failed write is noticed here. */
int outfile_close(struct outfile *o, struct error *err);
/* Close and remove the unfinished file; a zeroed *o is allowed. */
void outfile_abandon(struct outfile *o);
/* "path: cannot write: why" from errno, EX_IOERR; returns -1. */
int outfile_error(const struct outfile *o, struct error *err);

#endif
