/* Places of Gaussians in the source picture (struct splat_place_view), in double
 * precision: the last channels of a reference's colours. */
#ifndef SPID_TESTS_SPLAT_PLACES_H
#define SPID_TESTS_SPLAT_PLACES_H

#include "lib/splat/reference.h"

struct reference_places {
    struct splat_place_view view;
    double *uv, *confidence, *shorter;   /* (N,2) from -1 to 1, (N) c, (N) s */
    double *around, *grain, *unrolled;   /* the same in the grain, or NULL */
};
/* Free what it holds; zeroed then. */
void reference_places_release(struct reference_places *p);

/* The last SPLAT_PLACE_CHANNELS of t->color become those of where its Gaussians
 * are. */
void reference_places_fill(const struct reference *t,
                           const struct reference_places *p);
/* center (2) += what the gradient of Gaussian i's colours, d (C), pulls at its
 * middle `at` with. */
void reference_places_backward(double center[2], const double *d,
                               const struct reference_point *at,
                               const struct reference *t,
                               const struct reference_places *p, size_t i);

#endif
