/* Labelled pictures, from files of lib/lab/people/label_rows.h.  A row without a
 * face is left out. */
#ifndef SPID_LAB_FIT_LABELS_H
#define SPID_LAB_FIT_LABELS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/lab/people/landmark_sets.h"
#include "lib/head/arkit.h"

struct label {
    char *file;                 /* as named, relative to the labels' folder */
    uint64_t frame;             /* in the file, from 0 */
    size_t person, clip;        /* numbers; a clip is the frames of a file */
    double at[LANDMARK_COUNT][2];       /* pixels of the picture */
    double blend[ARKIT_COUNT];  /* by our components; 0 where no name is */
};

/* In the order of people, of each the files as they came, of each the
 * frames. */
struct labels {
    struct label *label;
    size_t count, people, clips;
};

#define LABEL_NAMES 64

/* Beginnings of names, borrowed. */
struct label_names {
    const char *begin[LABEL_NAMES];
    size_t n;
};

/* Whether name begins as one of them does. */
bool label_is_named(const char *name, const struct label_names *of);

/* Add the rows of a file.  Names that begin as `except` says are left out.  -1
 * and *err naming file, tensor and row when something is missing, misshapen or
 * not finite. */
int labels_read(struct labels *l, const char *path,
                const struct label_names *except, struct error *err);

/* Give people and clips their numbers and sort.  Frames of a video are one
 * person's; a picture's person is its name without what follows the last
 * '_' or, when there is none, without the digits at either end, in the same
 * folder.  same (nsame) are pairs of names without folder and extension that
 * are one person too.  EX_DATAERR when a name of them does not occur, or when
 * there is no label. */
int labels_sort(struct labels *l, const char *const (*same)[2], size_t nsame,
                struct error *err);
/* Free what it holds; zeroed then. */
void labels_release(struct labels *l);

#endif
