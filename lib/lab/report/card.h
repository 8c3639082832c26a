/* What a model's card says of its limits. */
#ifndef SPID_LAB_REPORT_CARD_H
#define SPID_LAB_REPORT_CARD_H

#include <stdio.h>

#include "lib/base/error.h"

/* The list under "## Limits" of the card (Markdown) at path, as a list of the
 * page.  0: written; 1: the card has no such section; -1: it cannot be
 * read. */
int card_write_limits(FILE *f, const char *path, struct error *err);

#endif
