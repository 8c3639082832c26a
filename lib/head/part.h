/* Some of a head's vertices, posed at the cost of a few: a head of their own. */
#ifndef SPID_HEAD_PART_H
#define SPID_HEAD_PART_H

#include "lib/base/error.h"
#include "lib/head/lbs.h"

struct head_part {
    struct head head;       /* V: theirs; shares nothing that moves */
    struct identity id;     /* for head_pose */
    float *verts;           /* (V,3), the last head_part_pose's */
};

/* vertex (n): which, of a folded identity, which is borrowed together with its
 * head.  EX_OSERR. */
int head_part_init(struct head_part *p, const struct identity *id,
                   const int32_t *vertex, size_t n, struct error *err);
/* Free what it holds; zeroed then. */
void head_part_release(struct head_part *p);
/* Their places, head frame, those of head_pose up to the order of blocks
 * (tests/unit/track_motion.c: 1e-6): p->verts, which is returned. */
const float *head_part_pose(struct head_part *p, const struct head_motion *m);

#endif
