/* Python pickles (protocols 0 to 5) as plain data.  Nothing is executed: the
 * machine knows how numpy's arrays, dtypes and scalars, PyTorch's tensors and
 * storages and ordered dictionaries are filled in.  Anything else that a name
 * is called or made into becomes an object, which is its name and what was
 * put into it, and does nothing.  A pickle is hostile until it ends: sizes,
 * counts, memory and the memo are limited, and every array has been checked
 * against the bytes that are there. */
#ifndef SPID_LAB_IMPORT_PICKLE_H
#define SPID_LAB_IMPORT_PICKLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "formats/arrayview.h"
#include "lib/base/error.h"

#define PICKLE_MAX_MEMORY ((size_t)64 << 20) /* of objects, bytes */
#define PICKLE_MAX_ITEMS ((size_t)1 << 20)   /* stack, memo */
#define PICKLE_FULL_NAME 130
#define PICKLE_MAX_KEYS 64                   /* of an object's state */

enum pickle_kind {
    PICKLE_NONE,
    PICKLE_BOOL, PICKLE_INT,                 /* u.i */
    PICKLE_FLOAT,                            /* u.f */
    PICKLE_LONG,                             /* u.s: more than 64 bits, as
                                              * bytes, lowest first */
    PICKLE_BYTES,                            /* u.s: Python 2 strings too */
    PICKLE_TEXT,                             /* u.s, UTF-8 */
    PICKLE_LIST, PICKLE_TUPLE, PICKLE_SET,   /* u.list */
    PICKLE_DICT,                             /* u.list: key, value, key, .. */
    PICKLE_NAME,                             /* u.name: class or function */
    PICKLE_DTYPE, PICKLE_STORAGE,
    PICKLE_ARRAY,                            /* u.array: numpy's, PyTorch's */
    PICKLE_OBJECT                            /* u.object: of any class */
};

struct pickle_value;

struct pickle_text {
    const char *p;          /* in the pickle, or in memory of its own */
    size_t n;
};

struct pickle_list {
    struct pickle_value **item;
    size_t n, room;
};

/* PyTorch: elements that lie outside of the pickle, under a key. */
struct pickle_storage {
    enum st_dtype dtype;
    struct pickle_text key;
    size_t count;           /* elements */
    size_t first;           /* legacy: where this view of it begins */
    const void *data;       /* NULL, or in the pickle itself */
};

struct pickle_dtype {
    bool known;             /* false: strings, structures, complex.. */
    char kind;              /* as numpy's; 'O': objects */
    size_t size;
    bool swap;
};

struct pickle_array {
    bool filled;            /* numpy makes it empty and fills it in later */
    bool known;             /* false: no dtype of ours */
    struct array_view view;
    const char *data;       /* numpy's; NULL: in the storage */
    const struct pickle_storage *storage;
    size_t first;           /* element of the storage */
    const struct pickle_value *objects;   /* dtype O: a list */
};

/* A class or function that was named; one without a name is what opcodes made
 * that name none. */
struct pickle_name {
    struct pickle_text module, name;
    int known;              /* to the machine; 0: it is not */
};

/* What a name was called or made into. */
struct pickle_object {
    struct pickle_name of;
    struct pickle_value *items;     /* list or dict of what was put in, or */
    struct pickle_value *state;     /* its attributes, a dict; NULL: none */
    bool own;                       /* items are no other value's too */
    bool inside;                    /* free for whoever walks the values */
};

struct pickle_value {
    enum pickle_kind kind;
    size_t at;              /* byte of the opcode that made it */
    union {
        int64_t i;
        double f;
        struct pickle_text s;
        struct pickle_list list;
        struct pickle_name *name;
        struct pickle_dtype *dtype;
        struct pickle_array *array;
        struct pickle_storage *storage;
        struct pickle_object *object;
    } u;
};

struct pickle;

/* The first pickle in size bytes at data, which must stay; *used (may be
 * NULL) gets its length.  NULL on failure; *err is "byte N: OPCODE: what". */
struct pickle *pickle_read(const void *data, size_t size, size_t *used,
                           struct error *err);
/* What the whole pickle is; it lives as long as the pickle. */
const struct pickle_value *pickle_root(const struct pickle *p);
/* PyTorch: all storages that tensors may lie in, in the order of mention. */
const struct pickle_list *pickle_storages(const struct pickle *p);
/* The first thing that made an object, "byte N: OPCODE: NAME is not allowed
 * (..)": why a pickle holds no data that should.  NULL: none did. */
const char *pickle_refused(const struct pickle *p);
/* Bytes of memory that the values take. */
size_t pickle_memory(const struct pickle *p);
void pickle_free(struct pickle *p);          /* NULL is allowed */

/* Value of a string key, or NULL; of a dictionary of at most
 * PICKLE_MAX_KEYS keys. */
struct pickle_value *pickle_get(const struct pickle_value *dict,
                                const char *key);
/* Whether a text is this word; this word, or it and a dot and more. */
bool pickle_text_is(struct pickle_text s, const char *word);
bool pickle_text_begins(struct pickle_text s, const char *word);
/* Whether a string is this one. */
bool pickle_is(const struct pickle_value *text, const char *word);
/* "list", "text", ..: what a value is called in messages; NULL: "nothing". */
const char *pickle_kind_name(const struct pickle_value *v);
/* "argparse.Namespace", printable. */
void pickle_full_name(char out[PICKLE_FULL_NAME], const struct pickle_name *n);

#endif
