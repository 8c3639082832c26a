/* Bending at the neck.  A camera that follows the head turns everything with
 * it; shoulders stay.  In the head's frame they move the other way, and the
 * neck is where the two meet: a point x goes to x + w (B x - x), B being the
 * rigid motion of the shoulders about a pivot in the neck and w in [0,1] how
 * much of the shoulders is in x. */
#ifndef SPID_GEOM_BEND_H
#define SPID_GEOM_BEND_H

#include <stddef.h>

struct bend {
    float pivot[3];     /* head units, in the neck */
    float top, bottom;  /* heights where the weight is 0, and 1 */
};

/* w of a point at height y. */
float bend_weight(const struct bend *b, float y);

/* body (3,4) = [M | p - M p], M = R^T from: where shoulders that `from` (3,3)
 * takes to the camera's axes are in the frame of a head seen by cam = [R|t];
 * p is the pivot. */
void bend_body(float body[12], const float pivot[3], const float from[9],
               const float cam[12]);

/* out (N,3), which may be x, from x (N,3) and weight (N). */
void bend_points(float *out, const float *x, const float *weight, size_t N,
                 const float body[12]);

/* dx (N,3, or NULL) is added to; dcam (3,4, or NULL) += the gradient by the R
 * that bend_body took. */
void bend_points_backward(float *dx, float dcam[12], const float *dout,
                          const float *x, const float *weight, size_t N,
                          const float pivot[3], const float from[9],
                          const float cam[12]);

#endif
