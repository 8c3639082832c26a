/* The 68 landmarks of a head without posing all of it. */
#ifndef SPID_TRACK_LANDMARKS_H
#define SPID_TRACK_LANDMARKS_H

#include "lib/base/error.h"
#include "lib/head/head.h"
#include "lib/head/part.h"

struct landmarks {
    struct head_part part;          /* at most 204 vertices */
    int32_t corner[HEAD_LANDMARKS * 3];     /* into part's vertices */
    const float *bary;              /* (68,3), the head's */
};

/* For a folded identity, which is borrowed together with its head.
 * EX_CONFIG when the head has no landmarks. */
int landmarks_init(struct landmarks *l, const struct identity *id,
                   struct error *err);
/* Free what it holds; zeroed then. */
void landmarks_release(struct landmarks *l);

/* lmk (68,3), head frame: as head_landmarks of head_pose, same bits up to the
 * order of blocks (tests/unit/track_motion.c: 1e-6). */
void landmarks_pose(float *lmk, struct landmarks *l,
                    const struct head_motion *m);

#endif
