/* Names with a number in them, such as frames/%05d.png, of sequences of
 * pictures. */
#ifndef SPID_FORMATS_PATTERN_H
#define SPID_FORMATS_PATTERN_H

#include <stdint.h>

#include "lib/base/error.h"

/* Placeholders in a name: %d, %5d or %05d; %% is a percent sign.  -1 for any
 * other use of the sign. */
int pattern_count(const char *path);
/* The name of frame n, for the caller to free; NULL without memory. */
char *pattern_name(const char *path, uint64_t n);
/* The first and last number of which there is a file, and that there is one
 * for all between.  -1 and *err: the placeholder is not in the file's own
 * name, there is none, or one is missing, which is named. */
int pattern_find(const char *path, uint64_t *first, uint64_t *last,
                 struct error *err);

#endif
