/* How far a head file's surface is from the scans' own faces. */
#ifndef SPID_LAB_HEAD_COMPARE_H
#define SPID_LAB_HEAD_COMPARE_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/head/head.h"
#include "lib/lab/head/scan.h"

/* Distances in mm of the scans' vertices to our surface. */
struct compare_part {
    const char *name;
    size_t n;                   /* vertices of the scans in one face */
    double mean, p95, worst;    /* mean and 95 % over all, largest */
};
enum { COMPARE_PARTS = 4 };     /* face, lids, lips, head and neck */

/* Of `people` random faces: identity weights standard normal, each ARKit
 * weight 0 to 1 with probability `active`, else 0; contradicting ones not
 * together.  The same for the same seed. */
int compare_faces(struct compare_part part[COMPARE_PARTS],
                  const struct head *h, const struct scan *s, int people,
                  double active, uint64_t seed, struct error *err);

#endif
