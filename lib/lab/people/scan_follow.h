/* The scans' mesh along the head's arcs.  Joints turn; the scans' shapes move
 * on straight lines.  At weights of 0 and 1 they agree, between them the
 * scans' skin takes the head's way: what the head does beyond the straight
 * line is added to the vertices near it. */
#ifndef SPID_LAB_PEOPLE_SCAN_FOLLOW_H
#define SPID_LAB_PEOPLE_SCAN_FOLLOW_H

#include "lib/head/lbs.h"
#include "lib/lab/people/scan_face.h"

#define FOLLOW_RIGS 13          /* components that are joints or lids */

/* Head vertices that carry each of the scans' skin vertices. */
struct follow_map {
    const struct head *head;
    int32_t *bind;              /* (FACE_NECK_END,4) */
    float *weight;              /* (FACE_NECK_END,4) */
};

/* Four vertices of h's skin, with weights, for each of f's; h is borrowed. */
int follow_map_init(struct follow_map *m, const struct scan_face *f,
                    const struct head *h, struct arena *memory,
                    struct error *err);

/* One person's: what each component does at weight 1. */
struct follow {
    const struct follow_map *map;
    const struct identity *id;
    float *full;                /* (FOLLOW_RIGS,V,3) */
};

/* A person of m (borrowed) with the shape folded into id (borrowed). */
int follow_init(struct follow *o, const struct follow_map *m,
                const struct identity *id, struct arena *memory,
                struct error *err);

/* x (FACE_VERTICES,3), the expression w of the person `rest` on straight
 * lines, comes onto the arcs.  verts (V,3): the head's posed vertices; scratch
 * (V,3). */
void follow_bend(float *x, float *scratch, const struct follow *o,
                 const struct scan_face *f, const float *rest,
                 const float *verts, const float *w);

#endif
