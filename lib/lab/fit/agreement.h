/* How well a fit follows its labels: mouth, lids, brows and irises of both,
 * measured alike, compared frame by frame within each clip. */
#ifndef SPID_LAB_FIT_AGREEMENT_H
#define SPID_LAB_FIT_AGREEMENT_H

#include <stdio.h>

#include "lib/base/error.h"
#include "lib/lab/fit/face_fit.h"

/* Write a table (tab-separated): for each clip of at least eight frames, and
 * for all pictures together, correlation and slope (fit over labels) of what
 * is measured; gaze where the eyes are half open at least. */
int agreement_write(FILE *out, const struct face_fit *f, struct error *err);

#endif
