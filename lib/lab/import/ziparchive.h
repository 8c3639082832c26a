/* Zip archives to read, through libzip.  An archive is hostile until it has
 * been opened: entries that are encrypted, double, compressed by other means
 * than deflate or beyond reason, that share bytes, or whose sizes lie, are
 * refused by name before anything is unpacked. */
#ifndef SPID_LAB_IMPORT_ZIPARCHIVE_H
#define SPID_LAB_IMPORT_ZIPARCHIVE_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"

#define ZIP_MAX_ENTRIES 65536
#define ZIP_MAX_RATIO 100            /* unpacked to packed, above ZIP_SMALL */
#define ZIP_SMALL ((uint64_t)1 << 20)   /* bytes of an entry */

struct ziparchive;

/* NULL on failure; *err does not name the file. */
struct ziparchive *ziparchive_open(const char *path, struct error *err);
void ziparchive_close(struct ziparchive *z);     /* NULL is allowed */

/* How many entries there are. */
size_t ziparchive_count(const struct ziparchive *z);
/* The name of the i-th, which lives as long as the archive. */
const char *ziparchive_name(const struct ziparchive *z, size_t i);
/* Unpacked bytes. */
size_t ziparchive_size(const struct ziparchive *z, size_t i);
/* Index of an entry, or SIZE_MAX. */
size_t ziparchive_find(const struct ziparchive *z, const char *name);

/* The first bytes of an entry, at most `bytes`; *have says how many.  Their
 * checksum is not known yet. */
int ziparchive_peek(void *out, size_t bytes, size_t *have,
                    struct ziparchive *z, size_t i, struct error *err);
/* All of an entry, unpacked into ziparchive_size bytes, its checksum checked.
 * Errors name the entry. */
int ziparchive_read(void *out, struct ziparchive *z, size_t i,
                    struct error *err);

#endif
