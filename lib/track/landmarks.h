/* The 68 landmarks of a head without posing all of it: the vertices they hang
 * on, as a small head of their own. */
#ifndef SPID_TRACK_LANDMARKS_H
#define SPID_TRACK_LANDMARKS_H

#include "lib/base/error.h"
#include "lib/head/head.h"
#include "lib/head/lbs.h"

struct landmarks {
    struct head sub;                /* V <= 204; shares nothing that moves */
    struct identity id;
    int32_t corner[HEAD_LANDMARKS * 3];     /* into sub's vertices */
    const float *bary;              /* (68,3), the head's */
    float *verts;                   /* (sub.V,3) */
};

/* For a folded identity, which is borrowed together with its head.
 * EX_CONFIG when the head has no landmarks. */
int landmarks_init(struct landmarks *l, const struct identity *id,
                   struct error *err);
/* Free what it holds; zeroed then. */
void landmarks_release(struct landmarks *l);

/* lmk (68,3), head frame: as head_landmarks of head_pose, same bits up to the
 * order of blocks (tests/unit/track_landmarks.c: 1e-6). */
void landmarks_pose(float *lmk, struct landmarks *l,
                    const struct head_motion *m);

#endif
