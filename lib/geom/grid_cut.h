/* Which pixels of a picture belong together: the minimum cut of a grid whose
 * nodes are tied to their eight neighbours, to a source and to a sink. */
#ifndef SPID_GEOM_GRID_CUT_H
#define SPID_GEOM_GRID_CUT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"

/* Ways to a neighbour, in reading order: 0 up and left, 1 up, 2 up and right,
 * 3 left ... 7 down and right.  7 - k leads back. */
#define GRID_CUT_WAYS 8

struct grid_cut_node {
    int32_t left[GRID_CUT_WAYS];    /* what is left of the ties' capacities */
    int32_t excess;                 /* the same of the tie to the source, or,
                                     * negative, to the sink */
    int32_t level;                  /* steps to its terminal, 1 beside it */
    int32_t next;                   /* orphan of the same level, or -1 */
    uint8_t tree, parent;
};

struct grid_cut {
    size_t width, height;
    struct grid_cut_node *node;     /* (height + 2, width + 2): the border has
                                     * no ties */
    uint8_t known;                  /* the tree that is complete */
};

/* A grid without ties; -1 without memory. */
int grid_cut_init(struct grid_cut *g, size_t width, size_t height,
                  struct error *err);
void grid_cut_release(struct grid_cut *g);
/* No ties again. */
void grid_cut_clear(struct grid_cut *g);

/* Tie (x,y) to the source, or by a negative number to the sink: of two ties
 * only the difference matters.  Less than 2^31; calls add up. */
void grid_cut_tie_terminal(struct grid_cut *g, size_t x, size_t y,
                           int32_t capacity);
/* Tie (x,y) to a neighbour, either way.  Less than 2^30. */
void grid_cut_tie(struct grid_cut *g, size_t x, size_t y, int way,
                  int32_t capacity);

/* Find the cut; uses the ties up.  -1 without memory. */
int grid_cut_run(struct grid_cut *g, struct error *err);
/* Then: whether (x,y) is on the source's side. */
bool grid_cut_is_source(const struct grid_cut *g, size_t x, size_t y);

#endif
