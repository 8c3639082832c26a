/* A head's arrays through the files that FLAME comes in. */
#ifndef SPID_TESTS_FLAME_FILE_H
#define SPID_TESTS_FLAME_FILE_H

#include "lib/head/head.h"

/* Write a as FLAME is pickled (Python 2, float64, chumpy, scipy) with
 * landmarks and lids, import that (lib/lab/convert), and load the result into h.
 * -1 and *err on failure. */
int flame_file_import(struct head *h, const struct head_arrays *a,
                      struct error *err);

#endif
