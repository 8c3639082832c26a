/* A file of labelled pictures (safetensors), one row for each frame of
 * photographs and clips:
 *   landmarks f32 [N,478,3]  pixels of the picture, x right, y down
 *   blendshapes f32 [N,52]   0 to 1, names in metadata blendshape_names
 *   found u8 [N]             0: no face
 *   metadata names           JSON list of "file#frame" */
#ifndef SPID_LAB_PEOPLE_LABEL_ROWS_H
#define SPID_LAB_PEOPLE_LABEL_ROWS_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/arena.h"
#include "lib/head/arkit.h"
#include "lib/lab/people/landmark_map.h"

struct label_rows {
    size_t n, columns;
    const float (*landmark)[LANDMARK_COUNT][3];         /* (n) */
    const float *blend;                                 /* (n,columns) */
    int column[ARKIT_COUNT];    /* of blend, by our components; -1: none */
    const int32_t *found;                               /* (n) */
    const char **name;                                  /* (n) */
    struct arena memory;
};

/* All of the file.  -1 and *err naming file and tensor when something is
 * missing, misshapen or not finite; to be released in either case. */
int label_rows_read(struct label_rows *r, const char *path, struct error *err);
/* Free what it holds. */
void label_rows_release(struct label_rows *r);

/* A weight of 1 of component k for one of the labels': their full blink is 0.6
 * or 0.7, a talking jaw 0.4. */
double label_gain(int k);

#endif
