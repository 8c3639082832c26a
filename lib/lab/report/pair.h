/* Driver and result side by side as one video, so that both always show the
 * same frame. */
#ifndef SPID_LAB_REPORT_PAIR_H
#define SPID_LAB_REPORT_PAIR_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/base/crop.h"

#define PAIR_FRAMES 1500        /* at most: what is later is left out */

struct pair {
    size_t frames;
    size_t size;                /* pixels of one side of each half */
    double rate;                /* frames a second */
    uint8_t *mp4;               /* the file, owned */
    size_t bytes;
};

/* The driver's clip on the left, inside the square `window` of it (NULL: its
 * middle), the result's on the right, as long as both last.  -1 and *err when
 * one is damaged or the video cannot be made. */
int pair_make(struct pair *p, const char *driver, const char *result,
              const struct square *window, struct error *err);
/* Free what it holds; zeroed then. */
void pair_release(struct pair *p);

#endif
