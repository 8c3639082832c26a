/* Blending at the neck.  A camera that follows the head turns everything with
 * it (the paper's T_d); shoulders stay.  In the head's frame they move the
 * other way, and the neck is where the two meet: linear blend skinning with
 * two bones, x to x + w (B x - x), B being the rigid motion of the shoulders
 * about a pivot in the neck and w in [0,1] how much of the shoulders is in
 * x.  The records call w "bend" and B "body". */
#ifndef SPID_BASE_NECK_BLEND_H
#define SPID_BASE_NECK_BLEND_H

#include <stddef.h>

struct neck_blend {
    float pivot[3];     /* head units, in the neck */
    float top, bottom;  /* heights where the weight is 0, and 1 */
};

/* Shoulders that nothing is known of stand upright before the camera: (3,3),
 * what takes them to the camera's axes. */
extern const float neck_blend_upright[9];

/* The smallest range of weight (N) from `begin` on that holds all weights but
 * zeros; count 0 when there are none. */
void neck_blend_range(size_t *first, size_t *count, const float *weight,
                      size_t begin, size_t end);

/* body (3,4) = [M | p - M p], M = R^T from: where shoulders that `from` (3,3)
 * takes to the camera's axes are in the frame of a head seen by cam = [R|t];
 * p is the pivot. */
void neck_blend_body(float body[12], const float pivot[3],
                     const float from[9], const float cam[12]);

/* Shoulders mostly stay where they are while a head shifts a little: stay (3),
 * in the frame of a head seen by cam (3,4), is the way back from where its neck
 * took them to where the source's camera (3,4) saw them, all of it for ways
 * that are short against NECK_BLEND_STAY and no more than that for long ones.
 * Added to a body's translation. */
#define NECK_BLEND_STAY 0.1f    /* head units: 20 mm */
void neck_blend_stay(float stay[3], const float pivot[3],
                     const float source[12], const float cam[12]);

/* out (N,3), which may be x, from x (N,3) and weight (N). */
void neck_blend_points(float *out, const float *x, const float *weight,
                       size_t N, const float body[12]);

/* dx (N,3, or NULL) is added to; dcam (3,4, or NULL) += the gradient by the R
 * that neck_blend_body took. */
void neck_blend_points_backward(float *dx, float dcam[12], const float *dout,
                                const float *x, const float *weight,
                                size_t N, const float pivot[3],
                                const float from[9], const float cam[12]);

#endif
