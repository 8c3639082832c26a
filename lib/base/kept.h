/* Inputs that can be read once, as standard input and pipes can, kept so that
 * they are read as any file is. */
#ifndef SPID_BASE_KEPT_H
#define SPID_BASE_KEPT_H

#include <stddef.h>

#include "lib/base/error.h"

#define KEPT_PATH 24

struct kept {
    int fd;                     /* of a nameless temporary file; 0: none */
    char path[KEPT_PATH];       /* to open it by */
    const char *name;           /* as people know it */
};

/* The path to open: that of *k, a copy of standard input ("-") or of a pipe, of
 * `max` bytes at most, or else `path` as it is.  NULL and *err, which names
 * the input: EX_DATAERR when there is more, EX_USAGE for a terminal, EX_IOERR
 * when it cannot be read or kept (TMPDIR, see file_temporary). */
const char *kept_open(struct kept *k, const char *path, size_t max,
                      struct error *err);
/* The copy goes, and *err, if it speaks of it, has the input's own name.
 * Returns rc. */
int kept_close(struct kept *k, int rc, struct error *err);

#endif
