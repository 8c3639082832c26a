/* PLY files as what they are: elements in order, each with rows of named
 * numbers, as text or binary in either byte order. */
#ifndef SPID_FORMATS_PLY_TABLE_H
#define SPID_FORMATS_PLY_TABLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "lib/base/error.h"

#define PLY_PROPERTIES 256      /* of an element */
#define PLY_ELEMENTS 8
#define PLY_NAME 64

enum ply_number { PLY_I8, PLY_U8, PLY_I16, PLY_U16, PLY_I32, PLY_U32, PLY_F32,
                  PLY_F64, PLY_NUMBERS };
enum ply_form { PLY_LITTLE, PLY_BIG, PLY_ASCII };

struct ply_property {
    char name[PLY_NAME];
    enum ply_number type;
    size_t offset;              /* bytes, in a binary row */
};

struct ply_element {
    char name[PLY_NAME];
    size_t n, count, stride;    /* rows, properties, bytes of a binary row */
    bool lists;                 /* rows of no fixed size: cannot be read */
    struct ply_property property[PLY_PROPERTIES];
};

struct ply_table {
    FILE *file;
    const char *path;           /* borrowed */
    enum ply_form form;
    size_t elements;
    struct ply_element element[PLY_ELEMENTS];
    char *row;                  /* room for a binary one */
};

/* Read the header; NULL and *err (EX_NOINPUT, EX_DATAERR: what in it).  The
 * file is large enough for the rows that it announces, up to the first element
 * with lists. */
struct ply_table *ply_table_open(const char *path, struct error *err);
void ply_table_close(struct ply_table *t);      /* NULL is allowed */

/* The element, or property of an element, of that name; NULL: none. */
const struct ply_element *ply_table_find(const struct ply_table *t,
                                         const char *name);
const struct ply_property *ply_element_find(const struct ply_element *e,
                                            const char *name);

/* out (e->count) = row i of e, for the message.  Rows are read in the order of
 * the file, all of an element before the next one. */
int ply_table_row(double *out, struct ply_table *t,
                  const struct ply_element *e, size_t i, struct error *err);
/* Pass over the rows of the elements before e. */
int ply_table_skip_to(struct ply_table *t, const struct ply_element *e,
                      struct error *err);

/* EX_DATAERR with the path in front. */
int ply_table_fail(const struct ply_table *t, struct error *err,
                   const char *format, ...)
    __attribute__((format(printf, 3, 4)));

#endif
