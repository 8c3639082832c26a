/* Alpha matting in one step: how much of every pixel is the person, how sure
 * that is, and the background's colour, from a prior for the coverage and from
 * the statistics of the colours to both sides (Chuang et al. 2001, with the
 * coverage summed over and not maximised).
 *
 * About each place the person's colours and the background's are normally
 * distributed, with means and covariances of what is near and decided.  A pixel
 * is alpha F + (1 - alpha) B of one colour each; alpha is 0, 1 or, at a rim,
 * anything between.  A colour that neither side has shown says nothing.  The
 * prior times the likelihood of the pixel's colour is the posterior of alpha:
 * its mean is the matte, its spread the doubt, and the mean of B given both is
 * the background where a pixel is mostly that.  Behind more of a person it goes
 * on from there, and alpha is at least what mixes some colour with it to the
 * pixel's (backdrop.h). */
#ifndef SPID_PHOTO_MATTING_H
#define SPID_PHOTO_MATTING_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/crop.h"
#include "lib/base/error.h"

/* A picture as two layers, n x n pixels: rgb = alpha F + (1 - alpha) back, with
 * F the person's own colours (texture_straight in lib/texture gives them). */
struct matting {
    size_t n;
    struct extent inside;       /* the picture; its square may go on beyond */
    uint8_t *rgb;               /* (n,n,3) in; beyond the picture, out */
    uint8_t *alpha;             /* (n,n) out: 255, all is the person's */
    uint8_t *confidence;              /* (n,n) out: certainty, 255 less twice the
                                 * standard deviation of alpha */
    uint8_t *back;              /* (n,n,3) out: the background, also behind
                                 * the person */
};

/* The most coverage with which a pixel's background is believed. */
#define MATTING_BACK 127

/* All of m from prior (w,w), w > 1: the probability that a place of the same
 * square is the person's.  known: m->alpha is given in the picture, where the
 * prior (NULL if all is in it) is not asked; it stays but for that least.  Beyond
 * the picture's edges alpha is the prior's and nothing is sure; rgb there is both
 * layers together.  The same for any number of threads.  EX_OSERR without
 * memory. */
int matting_solve(struct matting *m, const float *prior, size_t w, bool known,
                  struct error *err);

#endif
