/* What spid-stream(5) says about each known record, as a table, and how
 * records become structs by it. */
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

/* ---- records as structs ------------------------------------------------ */

/* Where in a struct the pointer to an array's data of that type is. */
struct schema_field {
    const char *name;
    size_t at;                 /* offsetof */
    enum dtype dtype;
};

/* Point the n fields of out, zeroed before, into the record; arrays it may
 * leave out stay NULL.  -1 and *err naming the array as schema_check and
 * record_check_finite do. */
int schema_read(void *out, const struct record *rec,
                const struct schema_field *field, size_t n, struct error *err);
/* The arrays of a record of that type from the fields that are not NULL, in
 * their order, into a; returns how many.  size: what the letters of the
 * table's shapes (and '*') stand for, by letter; of shapes to choose from the
 * last one without a letter of SCHEMA_NOT. */
int schema_arrays(struct array *a, const char *type, const void *in,
                  const struct schema_field *field, size_t n,
                  const size_t *size);
#define SCHEMA_NOT ((size_t)-1)

/* Rows of an array of the record, 0 without it. */
size_t schema_rows(const struct record *rec, const char *name);

#endif
