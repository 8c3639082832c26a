/* Gradients of lib/splat/reference.h's pictures, in double precision: the truth
 * that the kernels' are held against. */
#ifndef SPID_TESTS_SPLAT_BACKWARD_H
#define SPID_TESTS_SPLAT_BACKWARD_H

#include "tests/reference/splat_places.h"

/* Gradients, overwritten; sizes as in struct reference, C = channels.
 * conic (N,3) and center (N,2) are those on the screen; each may be NULL, but
 * with places color may not: what pulls at the centres goes through it. */
struct reference_gradients {
    double *mean, *scale, *quat, *opacity, *color, *rt, *center, *conic;
    const struct reference_places *places;      /* filled in; or NULL */
};
/* Add to what g names, from d_image (H,W,C) and d_alpha (H,W; may be NULL).
 * EX_OSERR. */
int reference_backward(const struct reference_gradients *g,
                       const struct reference *t,
                       const double *d_image, const double *d_alpha,
                       struct error *err);

#endif
