/* Names of inputs: lists, folders and patterns of pictures spelled out. */
#ifndef SPID_FORMATS_INPUTS_H
#define SPID_FORMATS_INPUTS_H

#include <stdbool.h>

#include "lib/base/error.h"
#include "lib/base/names.h"

/* Whether it is a picture's name by its ending; hidden files are none. */
bool inputs_is_picture(const char *name);
/* Append what a name stands for (framesource_open).  -1 and *err. */
int inputs_add(struct names *s, const char *path, struct error *err);
/* Whether one of them is the file of that name, or among the first of a
 * pattern. */
bool inputs_have(const struct names *s, const char *name);

#endif
