/* A person cut from a picture as the networks' training data have it: the
 * portrait window, square, and the mask of who is in it. */
#ifndef SPID_LAB_FIT_PORTRAIT_H
#define SPID_LAB_FIT_PORTRAIT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/arena.h"
#include "lib/base/crop.h"
#include "lib/base/error.h"
#include "lib/head/lbs.h"
#include "lib/net/matte_net.h"
#include "lib/head/motion.h"

struct portrait {
    size_t size;                /* pixels a side */
    uint8_t *rgb;               /* (size,size,3) */
    uint8_t *mask;              /* (size,size) 255 person, soft at the rim */
    uint8_t *back;              /* (size,size,3) what the person hides */
    uint8_t *alone;             /* (size,size,3) the person over black */
    bool plain;                 /* the mask is sure nearly everywhere */
    uint8_t *confidence;        /* (size,size) of the mask */
    uint8_t *head;              /* (MATTE_SIDE,MATTE_SIDE) where that lands */
    struct arena memory;
    struct matte_net *net;      /* borrowed, set by the caller, or NULL */
};

/* Memory for portraits of size x size. */
int portrait_init(struct portrait *p, size_t size, struct error *err);
/* Free what it holds; zeroed then. */
void portrait_release(struct portrait *p);

/* Fill all from the window of a picture rgb (H,W,3).  The mask is matte_find's,
 * with p->net or, without it, by the head that motion poses id into.  It is 0
 * beyond the picture's border. */
int portrait_cut(struct portrait *p, const uint8_t *rgb, size_t W, size_t H,
                 struct square window, const struct identity *id,
                 const struct motion *motion, struct error *err);

#endif
