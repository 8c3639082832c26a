/* A list of clips to make: one per line, SOURCE tab DRIVER tab OUT; empty
 * lines and lines that start with # are skipped. */
#ifndef SPID_ANIMATE_JOBLIST_H
#define SPID_ANIMATE_JOBLIST_H

#include <stddef.h>

#include "lib/base/error.h"

struct job {
    const char *source, *driver, *out;
};

struct joblist {
    struct job *job;
    size_t count;
    char *text;                 /* what the names point into */
};

/* "-" is standard input.  EX_DATAERR naming file and line when a line has not
 * three fields or two lines have the same output. */
int joblist_read(struct joblist *l, const char *path, struct error *err);
/* Free what it holds; zeroed then. */
void joblist_release(struct joblist *l);

#endif
