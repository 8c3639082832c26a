/* Settings in JSON: which keys there are, where the value of each goes in a
 * struct and what it may be, as a table that reads and prints them. */
#ifndef SPID_BASE_KEYS_H
#define SPID_BASE_KEYS_H

#include <stdbool.h>
#include <stddef.h>

#include <cjson/cJSON.h>

#include "lib/base/error.h"

enum key_kind {
    KEY_SIZE, KEY_INT,          /* size_t, int64_t */
    KEY_DOUBLE, KEY_FLOAT,
    KEY_BOOL,
    KEY_TEXT,                   /* char[max] */
    KEY_WORD,                   /* an enum: the number of one of the words */
    KEY_JSON                    /* char *: an object, as text to be freed */
};

struct key {
    const char *name;           /* "loss.jaw" is jaw of the object loss */
    enum key_kind kind;
    size_t at;                  /* offsetof */
    double min, max;            /* of numbers; where they are the same there is
                                 * no field */
    double normal;              /* where none is given; false: 0 */
    const char *const *words;   /* of a KEY_WORD, NULL at the end */
};

/* The fields of the n keys that are numbers to their normal values. */
void keys_set_normal(void *out, const struct key *keys, size_t n);
/* The fields of the keys that are in the object root; others stay.  EX_CONFIG
 * naming the key, what was found and what was expected; where `known`, also
 * for a key that is not in the table. */
int keys_read(void *out, const struct key *keys, size_t n, const cJSON *root,
              bool known, struct error *err);
/* Every key into root, in the table's order (no KEY_JSON). */
void keys_print(cJSON *root, const struct key *keys, size_t n, const void *in);

#endif
