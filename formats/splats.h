/* Gaussians read from a file, linear as the renderer wants them. */
#ifndef SPID_FORMATS_SPLATS_H
#define SPID_FORMATS_SPLATS_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/error.h"
#include "lib/base/gaussians.h"

struct splats {             /* one allocation; zeroed: none */
    size_t n;
    int degree;             /* of the spherical harmonics, 0 to 3 */
    float *mean;            /* (N,3) */
    float *scale;           /* (N,3) standard deviations */
    float *quat;            /* (N,4) w,x,y,z unit */
    float *opacity;         /* (N) */
    float *color;           /* (N,3) of degree 0: 0.5 + SH0 f_dc */
    float *rest;            /* (N,3,(degree+1)^2 - 1) f_rest, channel-major;
                             * NULL when degree is 0.  In the file's axes. */
    bool rotated;           /* the file was taken as y down */
};

/* Room for n Gaussians with nrest higher harmonics.  EX_OSERR. */
int splats_allocate(struct splats *s, size_t n, int nrest, const char *path,
                    struct error *err);
/* Free what it holds; zeroed then. */
void splats_release(struct splats *s);
/* Them as three channels. */
struct gaussians splats_set(const struct splats *s);

#endif
