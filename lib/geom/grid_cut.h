/* The minimum cut of a grid whose nodes have edges to their eight neighbours,
 * to a source and to a sink: which pixels of a picture belong together. */
#ifndef SPID_GEOM_GRID_CUT_H
#define SPID_GEOM_GRID_CUT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"

/* Directions to neighbours in reading order: 0 up and left, 1 up, 2 up and
 * right, 3 left ... 7 down and right.  7 - dir leads back. */
#define GRID_CUT_NEIGHBOURS 8

struct grid_cut_node {
    int32_t residual[GRID_CUT_NEIGHBOURS];  /* capacity left, to each */
    int32_t excess;                 /* capacity left from the source or,
                                     * negative, to the sink */
    int32_t level;                  /* edges on the path to its terminal */
    int32_t next;                   /* orphan of the same level, or -1 */
    uint8_t tree, parent;           /* of the search (grid_cut.c) */
};

struct grid_cut {
    size_t width, height;
    struct grid_cut_node *node;     /* (height + 2, width + 2): the border has
                                     * no edges */
    uint8_t known;                  /* after grid_cut_run: the tree that
                                     * cannot grow, so is its side */
};

/* A grid without edges.  EX_OSERR. */
int grid_cut_init(struct grid_cut *g, size_t width, size_t height,
                  struct error *err);
/* Free what it holds; zeroed then. */
void grid_cut_release(struct grid_cut *g);
/* Remove all edges. */
void grid_cut_clear(struct grid_cut *g);

/* Add an edge from the source to (x,y) or, with a negative capacity, from
 * (x,y) to the sink: only the difference of both matters.  The sum stays below
 * 2^31. */
void grid_cut_link_terminal(struct grid_cut *g, size_t x, size_t y,
                            int32_t capacity);
/* An edge between (x,y) and a neighbour, of the same capacity in both
 * directions, less than 2^30. */
void grid_cut_link(struct grid_cut *g, size_t x, size_t y, int dir,
                   int32_t capacity);

/* Find the minimum cut; the capacities are overwritten.  EX_OSERR. */
int grid_cut_run(struct grid_cut *g, struct error *err);
/* After that: whether (x,y) is on the source's side. */
bool grid_cut_is_source(const struct grid_cut *g, size_t x, size_t y);

#endif
