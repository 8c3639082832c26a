/* Contact sheets of the sculpted head, to be looked at. */
#ifndef SPID_HEAD_SCULPT_SHEET_H
#define SPID_HEAD_SCULPT_SHEET_H

#include <stddef.h>

#include "lib/base/error.h"
#include "lib/head/sculpt.h"

/* Draw views of the mean head, ten people and a few expressions, each in a
 * square of `size` pixels, and write them to path as PNG. */
int sculpt_sheet(const char *path, const struct sculpt *s, size_t size,
                 struct error *err);

#endif
