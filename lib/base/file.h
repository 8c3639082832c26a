/* Files that take their name when they are complete, what must not be
 * replaced by one, and small ones read whole. */
#ifndef SPID_BASE_FILE_H
#define SPID_BASE_FILE_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/error.h"

/* The path exists and is not a regular file: a device, a fifo, a directory.
 * Such a thing is written in place or not at all. */
bool file_is_special(const char *path);

/* Are both the same regular file, under whatever names? */
bool file_is_same(const char *a, const char *b);

/* Does the name end so, in either case, with something in front?  file_ends("a.ply", ".ply") */
bool file_ends(const char *name, const char *ending);

/* Whether the name ends as that of a picture, a clip or a sound: what people
 * open by a double click, and nothing else must be written under. */
bool file_is_media_name(const char *name);

/* rename(2), but fails with EEXIST rather than replace something special.
 * 0, or -1 and errno. */
int file_rename(const char *part, const char *path);

#define FILE_TEMPORARY 256
/* path [FILE_TEMPORARY] = the folder for temporary files (TMPDIR, or /tmp) and
 * name, a template for mkdtemp(3) and its kin. */
void file_temporary(char *path, const char *name);

/* The folder that the running program lies in, with a slash.  False and "" when
 * that is not known. */
bool file_own_folder(char *folder, size_t size);

/* A regular file's bytes, *bytes of them, read-only, for munmap; it is not
 * empty.  NULL and *err, which names the path: EX_NOPERM, EX_NOINPUT, EX_OSERR,
 * EX_DATAERR. */
void *file_map(size_t *bytes, const char *path, struct error *err);

/* All *bytes of a file of at most `max`, and a 0 behind them; "-" is standard
 * input; the caller frees.  NULL and *err, which names the path: EX_NOINPUT when
 * it cannot be opened, EX_IOERR when reading fails (a folder, too), EX_DATAERR
 * when it is larger. */
char *file_read(size_t *bytes, const char *path, size_t max, struct error *err);
/* The same of a text, without a 0 inside, or EX_DATAERR. */
char *file_read_text(const char *path, size_t max, struct error *err);

#endif
