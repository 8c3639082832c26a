/* Parts of a plain figure, for scan_plain.c. */
#ifndef SPID_LAB_PEOPLE_SCAN_PLAIN_H
#define SPID_LAB_PEOPLE_SCAN_PLAIN_H

#include "lib/lab/people/scan.h"

/* Where a place p of the neutral face lies on the texture square: eyes, at
 * height `eye`, and lips are where photographs have them. */
void plain_uv(float uv[2], const float *p, float eye);

/* Skin, irises, a shirt and rooms of a, whose face and labels are there. */
int plain_make_looks(struct scan_assets *a, struct error *err);

#endif
