/* The clips of a run's folder, a few frames of each. */
#ifndef SPID_LAB_REPORT_CLIPS_H
#define SPID_LAB_REPORT_CLIPS_H

#include <stddef.h>

#include "formats/image.h"
#include "lib/base/error.h"
#include "lib/lab/report/report.h"

/* Path of dir/name, or of dir/name.anything that is no stream and no page; 0
 * when there is none. */
int run_find(char *path, size_t size, const char *dir, const char *name);

/* A few frames of a clip, spread evenly. */
struct clip {
    size_t count;
    size_t index[REPORT_FRAMES];
    struct image frame[REPORT_FRAMES];      /* owned */
};

/* Read path twice: once to count, once to keep REPORT_FRAMES frames. */
int clip_read(struct clip *c, const char *path, struct error *err);
/* Free what it holds; zeroed then. */
void clip_release(struct clip *c);

#endif
