/* The template avatar's mouth (lib/head/head_avatar.h): a generic set of teeth
 * with gums, and what is behind them.  Widths and heights of crowns are what
 * adults' teeth roughly have; the arch and its place behind the lips are
 * measured on the mean of the ICT scans. */
#ifndef SPID_LAB_HEAD_CROWNS_H
#define SPID_LAB_HEAD_CROWNS_H

#include "lib/head/head_avatar.h"

#define CROWNS_ARCH 0.031f  /* of the parabola z = -CROWNS_ARCH x^2 along which
                             * teeth stand, 1 / mm */

/* The mouth's arrays of a, of its side. */
void crowns_make(struct head_avatar *a);

#endif
