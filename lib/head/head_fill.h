/* What head.c and head_file.c share.  Not for other modules. */
#ifndef SPID_HEAD_HEAD_FILL_H
#define SPID_HEAD_HEAD_FILL_H

#include "formats/safetensors.h"
#include "lib/head/head.h"
#include "lib/head/runs.h"

/* head_init; st, when the arrays lie in a mapped file, gives pages back.
 * packed, unless it is NULL, has been checked and stands for a->shapedirs. */
int head_fill(struct head *h, const struct head_arrays *a,
              const struct runs_read *packed, const struct safetensors *st,
              struct error *err);

#endif
