/* Portraits for the matte network: people of whole pictures before their own
 * background or another one. */
#ifndef SPID_DATA_PORTRAIT_SAMPLE_H
#define SPID_DATA_PORTRAIT_SAMPLE_H

#include "lib/base/error.h"
#include "lib/data/data.h"

/* A portrait of f's person, n x n pixels, perhaps mirrored, cut about the
 * picture as how->jitter says and with colours changed as data_sample changes
 * them:
 *   rgb (n,n,3)   in [0,1], black outside of the picture
 *   alpha (n,n)   the person's coverage
 *   weight (n,n)  0 where something hides the person, else 1
 * A share how->background of them stands before something else: a wall of one
 * of the person's own colours, some other wall, or `behind`, upside down.  f
 * and behind are whole pictures; -1 where memory is short. */
int portrait_sample(float *rgb, float *alpha, float *weight, size_t n,
                    const struct data_frame *f,
                    const struct data_frame *behind,
                    const struct data_augment *how, struct random *r,
                    struct error *err);

#endif
