/* Which of MediaPipe's 478 face landmarks lie where, and the distances between
 * them that tell mouth, lids, brows and irises.  Left is the person's own. */
#ifndef SPID_LAB_PEOPLE_LANDMARK_SETS_H
#define SPID_LAB_PEOPLE_LANDMARK_SETS_H

#include "lib/lab/people/landmark_map.h"

enum {
    LANDMARK_LID = 16, LANDMARK_LIP = 40, LANDMARK_OVAL = 36,
    LANDMARK_BOX = 41, LANDMARK_SPANS = 11,
    LANDMARK_GAP = 4
};

extern const int landmark_lid[2][LANDMARK_LID];     /* loops, left, right */
extern const int landmark_lip[LANDMARK_LIP];        /* outer, inner loop */
extern const int landmark_oval[LANDMARK_OVAL];
extern const int landmark_box[LANDMARK_BOX];        /* brows, cheeks, chin: the
                                                     * extent of the 68 */
extern const int landmark_iris[2];                  /* centres */
extern const int landmark_corner[2][2];      /* of an eye: outer, inner */
extern const int landmark_upper[2][LANDMARK_GAP];   /* lid middles */
extern const int landmark_lower[2][LANDMARK_GAP];   /* those below them */

/* From the mean of one group of points to the mean of another. */
struct landmark_span {
    int from[6], nfrom, to[2], nto;
};
extern const struct landmark_span landmark_span[LANDMARK_SPANS];
enum {                          /* places in landmark_span */
    SPAN_MOUTH = 0,             /* gap, five times along the lips */
    SPAN_WIDTH = 5,             /* mouth corners, outer and inner */
    SPAN_BROW = 7               /* outer, inner; right, then left */
};

#endif
