/* Which of the scans' vertices the labels' landmarks mean. */
#ifndef SPID_LAB_PEOPLE_LANDMARK_MAP_H
#define SPID_LAB_PEOPLE_LANDMARK_MAP_H

#include <stdint.h>

#include "lib/base/error.h"

#define LANDMARK_FACE 468       /* of MediaPipe's face, without the irises */
#define LANDMARK_COUNT 478      /* with five of each */

/* What landmarks mean: the scan's vertex, and how loosely (cm). */
struct landmark_map {
    int32_t vertex[LANDMARK_FACE];
    double spread[LANDMARK_FACE];
};

/* Read a mediapipe_to_ict.json.  -1 and *err naming file and key when a list
 * is missing, of another length, out of range or names a landmark twice. */
int landmark_map_read(struct landmark_map *m, const char *path,
                      struct error *err);

#endif
