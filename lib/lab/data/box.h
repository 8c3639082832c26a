/* A rectangle of whole pixels. */
#ifndef SPID_LAB_DATA_BOX_H
#define SPID_LAB_DATA_BOX_H

#include <stdbool.h>
#include <stddef.h>

/* Pixels x0 <= x < x1, y0 <= y < y1. */
struct box {
    size_t x0, y0, x1, y1;
};

static inline bool box_is_empty(struct box b)
{
    return b.x1 <= b.x0 || b.y1 <= b.y0;
}

#endif
