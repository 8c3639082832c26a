/* Distances between two pictures of the same size.  Pictures are planar
 * float [C,H,W] with values in [0,1]; a is the truth, b what is judged.
 * Everything is computed in double. */
#ifndef SPID_LAB_EVAL_IMAGE_H
#define SPID_LAB_EVAL_IMAGE_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"

#define METRIC_CHANNELS 4     /* most planes of a picture */
#define METRIC_LEVELS 5       /* scales of MS-SSIM */
#define METRIC_MSSSIM_MIN 161 /* smallest side MS-SSIM is defined for */

/* Mean |a-b| and mean (a-b)^2 over n values, n > 0. */
double metric_l1(const float *a, const float *b, size_t n);
/* Mean (a-b)^2 likewise. */
double metric_mse(const float *a, const float *b, size_t n);
/* -10 log10(mse), peak 1; INFINITY when mse is 0. */
double metric_psnr(double mse);

/* SSIM: 11x11 Gaussian of sigma 1.5, valid region only, biased variances,
 * C1 = 1e-4, C2 = 9e-4. */
struct metric_ssim {
    double mean;                      /* of the channels */
    double channel[METRIC_CHANNELS];
};

/* SSIM of every plane.  map (may be NULL) receives [C,H-10,W-10]; db (may be
 * NULL) the gradient of the mean with respect to b, [C,H,W], overwritten.
 * Fails when a side is under 11 or memory is short. */
int metric_ssim(struct metric_ssim *out, double *map, double *db,
                const float *a, const float *b, size_t C, size_t H, size_t W,
                struct error *err);

struct metric_msssim {
    double mean;
    double level[METRIC_LEVELS][2][METRIC_CHANNELS]; /* ssim, cs */
};

/* Multi-scale SSIM: weights .0448 .2856 .3001 .2363 .1333, cs of scales 1-4
 * and ssim of scale 5 clipped at 0, multiplied per channel, then averaged.
 * Between scales 2x2 means; an odd side is padded by a zero on both ends
 * first.  db as above (zero where a clip is active).  Both sides must be at
 * least METRIC_MSSSIM_MIN. */
int metric_msssim(struct metric_msssim *out, double *db, const float *a,
                  const float *b, size_t C, size_t H, size_t W,
                  struct error *err);

/* Luma 0.2989 R + 0.587 G + 0.114 B of planar rgb [3,n]. */
void metric_gray(float *gray, const float *rgb, size_t n);

/* Sharpness: mean gradient magnitude of the luma, by forward differences;
 * planar rgb [3,H,W] of at least 2x2. */
double metric_edges(const float *rgb, size_t H, size_t W);

/* Interleaved 8-bit [n,3] to planar float [3,n] in [0,1]. */
void metric_planar_u8(float *planar, const uint8_t *rgb, size_t n);

/* Temporal flicker: mean over pixels of |(b1-b0) - (a1-a0)|, the change from
 * one frame to the next that the truth does not have. */
double metric_flicker(const float *a0, const float *a1, const float *b0,
                      const float *b1, size_t n);

#endif
