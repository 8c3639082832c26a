/* A JSON file, parsed whole. */
#ifndef SPID_FORMATS_JSONFILE_H
#define SPID_FORMATS_JSONFILE_H

#include <cjson/cJSON.h>
#include <stddef.h>

#include "lib/base/error.h"

/* Of `max` bytes at most; the caller deletes it.  NULL and *err, which names the
 * file. */
cJSON *jsonfile_read(const char *path, size_t max, struct error *err);

#endif
