/* A set of Gaussians as plain arrays: what scene files hold and the renderer
 * draws. */
#ifndef SPID_BASE_GAUSSIANS_H
#define SPID_BASE_GAUSSIANS_H

#include <stddef.h>
#include <stdint.h>

/* Gaussians in the caller's memory, read-only. */
struct gaussians {
    size_t n;
    int channels;                 /* floats in a row of color, 1 to 32 */
    const float *mean;            /* (N,3) centres, head units */
    const float *scale;           /* (N,3) standard deviations, head units */
    const float *quat;            /* (N,4) w,x,y,z; any length (see rules) */
    const float *opacity;         /* (N)   0 to 1 */
    const float *color;           /* (N,C) or NULL when color_half is set */
    const uint16_t *color_half;   /* (N,C) IEEE half, or NULL */
    const uint8_t *branch;        /* (N) 0 dynamic, 1 static, 2 mouth; may be
                                   * NULL: everything is drawn */
    const float *uv;              /* (N,2) where the source picture shows it,
                                   * 0..1 across, or NULL */
    const float *seen;            /* (N)   0..1: how much of that is so; or
                                   * NULL with uv: nothing is */
};

#endif
