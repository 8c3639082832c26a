/* The nearest of many points, by a k-d tree (Bentley 1975). */
#ifndef SPID_LAB_PEOPLE_SCAN_NEAR_H
#define SPID_LAB_PEOPLE_SCAN_NEAR_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/arena.h"

#define NEAR_MAX 8

struct near_tree {
    const float *p;             /* (n,3), borrowed */
    const float *normal;        /* (n,3) unit, borrowed, or NULL */
    size_t n;
    int32_t *item;              /* (n) in the tree's order */
};

/* Over n points p (n,3), borrowed. */
int near_init(struct near_tree *t, const float *p, size_t n,
              struct arena *memory, struct error *err);

/* The k (at most NEAR_MAX) points nearest to x within `reach`, nearest first;
 * with a normal n, only points whose own normal lies within 60 degrees.
 * Returns how many were found; d2 may be NULL. */
int near_find(int32_t *index, float *d2, const struct near_tree *t,
              const float x[3], const float *n, int k, float reach);

/* Weights (4) of the four nearest points, inverse to distance; adding to 1. */
void near_bind(int32_t index[4], float weight[4], const struct near_tree *t,
               const float x[3]);

#endif
