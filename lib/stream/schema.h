/* What spid-stream(5) says about each known record, as a table. */
#ifndef SPID_STREAM_SCHEMA_H
#define SPID_STREAM_SCHEMA_H

#include "lib/stream/stream.h"

/* One array of a known record.  shape: dimensions with commas between them; a
 * number is that size, a letter any size that is the same throughout the
 * record, "*" any size, and "|" stands between shapes of which one must fit.
 * dtypes: accepted, as "f32" or "f16 f32". */
struct schema {
    const char *type, *name, *dtypes, *shape;
    bool required;
    const char *unit;          /* units and meaning, a few words */
};

/* The table; ends with type == NULL. */
const struct schema *schema_table(void);

/* The row of a known record's array, or NULL. */
const struct schema *schema_find(const char *type, const char *name);

/* 0, or -1 with the first array of a known record that is missing or has
 * another dtype or shape than the table says.  Unknown records and arrays are
 * none of its business. */
int schema_check(const struct record *rec, struct error *err);

#endif
