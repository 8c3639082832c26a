/* How far a shape is from another, as a quadratic form of beta - beta*: no
 * vertex is made. */
#ifndef SPID_LAB_TRAIN_SHAPE_LOSS_H
#define SPID_LAB_TRAIN_SHAPE_LOSS_H

#include <stddef.h>

#include "lib/base/error.h"
#include "lib/head/head.h"

/* Points that shape directions move, and what size and place undo taken out:
 * a small head near by and a large one further off look the same, and E_m's
 * translation makes up for either. */
struct shape_loss {
    size_t n;               /* shape directions */
    double *gram;           /* (n,n), head units squared */
};

/* Over all vertices of h, or over its landmarks (0 everywhere when h has
 * none); of its first n directions. */
int shape_loss_init(struct shape_loss *l, const struct head *h, size_t n,
                    bool landmarks, struct error *err);
/* Free what it holds; zeroed then. */
void shape_loss_release(struct shape_loss *l);

/* What shape_loss leaves out: how large and where the face of one shape is
 * against that of another, x_a = size x_b + place, by the landmarks. */
struct shape_place {
    size_t n;
    double *along;          /* (4,n) of beta_a - beta_b: move, growth */
    double centre[3];       /* growth leaves it where it is */
};

/* A head without landmarks: always size 1, place 0. */
int shape_place_init(struct shape_place *p, const struct head *h, size_t n,
                     struct error *err);
/* Free what it holds; zeroed then. */
void shape_place_release(struct shape_place *p);
/* place in head units. */
void shape_place(double *size, double place[3], const float *a,
                 const float *b, const struct shape_place *p);

/* Root mean square over coordinates of the points' difference, head units;
 * g (n, or NULL) is its gradient by beta, overwritten. */
double shape_loss(double *g, const float *beta, const float *truth,
                  const struct shape_loss *l);

#endif
