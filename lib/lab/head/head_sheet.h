/* Contact sheets of a head, to be looked at. */
#ifndef SPID_LAB_HEAD_HEAD_SHEET_H
#define SPID_LAB_HEAD_HEAD_SHEET_H

#include <stddef.h>

#include "lib/base/error.h"
#include "lib/head/head.h"

/* Draw views of the mean head, people, jaw, lids and gaze, and expression
 * components 0 to 52 at weight 1 (ARKit's shapes, joints and lids included,
 * when the head has them), each in a square of `size` pixels, eight across,
 * and write them to path as PNG. */
int head_sheet(const char *path, const struct head *h, size_t size,
               struct error *err);

#endif
