/* Reading the assets' JSON files. */
#ifndef SPID_LAB_PEOPLE_SCAN_JSON_H
#define SPID_LAB_PEOPLE_SCAN_JSON_H

#include <cjson/cJSON.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"

/* The file's JSON, NULL and *err (naming the file) when there is none.  The
 * caller deletes it. */
cJSON *scan_json_read(const char *path, struct error *err);

/* out (n) = the list `key` of exactly n integers 0 <= i < limit. */
int scan_json_ints(int32_t *out, size_t n, int32_t limit, const cJSON *j,
                   const char *key, struct error *err);

#endif
