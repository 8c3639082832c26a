/* Portraits for the matte network: people of whole pictures before their own
 * background or another one. */
#ifndef SPID_LAB_DATA_PORTRAIT_SAMPLE_H
#define SPID_LAB_DATA_PORTRAIT_SAMPLE_H

#include "lib/base/error.h"
#include "lib/lab/data/data.h"

/* A portrait of f's person, n x n pixels, perhaps mirrored, with colours
 * changed as data_sample changes them:
 *   rgb (n,n,3)   in [0,1]; the picture's edges outside of it
 *   alpha (n,n)   the person's coverage
 *   weight (n,n)  0 where something hides the person and outside, else 1
 * With how->jitter every other picture ends sooner than its frame, where the
 * person's coverage is known still.
 * It shows the whole picture; with how->jitter mostly the portrait window
 * that a tracker would cut, and that not precisely.  A share how->background
 * of them stands before something else, in another light: a plain wall, often
 * of one of the colours at the person's outline, a room of many shapes, or a part of
 * the picture `behind`, which is upside down mostly if it has a face.  f and behind
 * are whole pictures; -1 where memory is short. */
int portrait_sample(float *rgb, float *alpha, float *weight, size_t n,
                    const struct data_frame *f,
                    const struct data_frame *behind,
                    const struct data_augment *how, struct random *r,
                    struct error *err);

#endif
