/* A list of pairs to compare: one per line, fields with tabs between. */
#ifndef SPID_LAB_EVAL_PAIRS_H
#define SPID_LAB_EVAL_PAIRS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "lib/base/error.h"

struct pair {
    const char *name;           /* the method: the table's row */
    bool motion;                /* streams of motion, not frames */
    const char *truth, *result;
    const char *protocol;       /* "self", "cross", another word; or NULL */
    const char *source;         /* picture the result was made of, or NULL */
};

struct pairs {
    struct pair *pair;
    size_t count;
    char *text;                 /* what the names point into */
};

/* Lines of name, "frames" or "motion", truth, result and, where there are
 * any, protocol and source; empty lines and those that begin with # are
 * skipped.  EX_DATAERR naming file and line; a list without pairs is one. */
int pairs_read(struct pairs *p, const char *path, struct error *err);
/* Free what it holds; zeroed then. */
void pairs_release(struct pairs *p);

/* What is explained under a table, as bits: protocols, and the null line. */
enum { PROTOCOL_SELF = 1, PROTOCOL_CROSS = 2, PROTOCOL_UNCHANGED = 4 };
/* The null line's row. */
#define PAIRS_UNCHANGED "frame 0 unchanged"
/* The bit of "self" or "cross"; 0 for any other word and for NULL. */
unsigned protocol_parse(const char *word);
/* What each of them is, a line each with `mark` in front. */
void protocols_write(FILE *f, unsigned protocols, const char *mark);

#endif
