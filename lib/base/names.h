/* Names of files: those given, a folder's entries, a text's lines. */
#ifndef SPID_BASE_NAMES_H
#define SPID_BASE_NAMES_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/error.h"

/* Zeroed before the first. */
struct names {
    char **name;
    size_t count, room;
};

/* Append a copy.  -1: EX_OSERR. */
int names_add(struct names *n, const char *name, struct error *err);
/* Append the entries of a folder that are wanted, as path/entry and as a person
 * counts them: 2 before 10.  How many there are; -1: EX_NOINPUT, EX_OSERR. */
int names_add_folder(struct names *n, const char *path,
                     bool wanted(const char *entry), struct error *err);
/* Append the lines of a text file, without the empty ones and those that begin
 * with '#'. */
int names_add_lines(struct names *n, const char *path, struct error *err);
/* Free what it holds; zeroed then. */
void names_release(struct names *n);

#endif
