/* Inside lib/track: the inner loops of photometric alignment, once per
 * instruction set.  Points lie in planes of `room` numbers, a multiple of
 * ALIGN_ROOM; what is beyond the last point weighs nothing. */
#ifndef SPID_TRACK_ALIGN_KERNEL_H
#define SPID_TRACK_ALIGN_KERNEL_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>

#include "lib/base/isa.h"
#include "lib/base/crop.h"

#define ALIGN_SIDE (CROP_NET / 2)       /* pixels of what is compared */
#define ALIGN_ROOM 16
#define ALIGN_UNKNOWNS 8        /* turn, move, gain, bias */
#define ALIGN_FACE_CODES 62     /* numbers of an expression, at most */
#define ALIGN_FACE_LIGHT 2      /* gain, bias: before them */
#define ALIGN_GAIN_SPREAD 0.1   /* of the light's gain about 1 */
#define ALIGN_FACE_UNKNOWNS (ALIGN_FACE_LIGHT + ALIGN_FACE_CODES)

/* Level of a pixel and its slopes to the right and down, 0 to 255. */
typedef float align_pixel __attribute__((vector_size(16)));

/* A whole number of the kernels' vectors. */
static inline size_t align_room(size_t n)
{
    return (n + ALIGN_ROOM - 1) / ALIGN_ROOM * ALIGN_ROOM;
}

/* Standard deviation of residuals, levels, from sums of weights and of weighted
 * |residual|; of pictures it is never under 1. */
static inline double align_sigma(double off, double weight)
{
    return fmax(1.2533 * off / weight, 1);
}

/* A pose and what it is seen through: pixels of the picture = focal *
 * normalised position + corner. */
struct align_camera {
    float R[9], t[3];
    float focal, corner[2];
    float low[2], high[2];      /* what of the picture may be looked at */
};

/* What a step is weighed by. */
struct align_residual {
    float gain, bias;           /* of the light */
    float centre[3];            /* what the head turns about, by the camera */
    float sigma;                /* Cauchy's weights: less beyond twice this */
};

/* What the points say of a pose. */
struct align_sums {
    double a[ALIGN_UNKNOWNS * ALIGN_UNKNOWNS];  /* J^T W J, lower triangle */
    double b[ALIGN_UNKNOWNS];   /* J^T W r */
    double weight, off;         /* sum of weights; of weight * |residual| */
    double x, y, xx, xy, yy;    /* for the correlation */
};

/* Points whose expression is sought. */
struct align_face_points {
    const float *point;         /* (3,room) by E_m's expression */
    const float *direction;     /* (codes,3,room) */
    const float *level, *weight;    /* (room) what a keyframe shows there */
    size_t room, codes;
};

/* What they say; unknowns that no code belongs to have rows of 0. */
struct align_face_sums {
    double a[ALIGN_FACE_UNKNOWNS * ALIGN_FACE_UNKNOWNS];    /* J^T W J
                                 * (unknowns,unknowns), lower triangle */
    double b[ALIGN_FACE_UNKNOWNS];  /* J^T W r */
    double weight, off;         /* as above */
};

/* picture (N,N) = grey levels of rgb (2N,2N,3) at half its size, blurred twice
 * (an expression moves fine detail first), and their slopes; N = ALIGN_SIDE.
 * work (2,N,N). */
typedef void align_picture_fn(align_pixel *picture, float *work,
                              const float *rgb);

/* level, facing (room): what points (3,room) show in the picture, and the
 * cosine of their normals (3,room) to the camera; 0 where they may not be
 * looked at. */
typedef void align_show_fn(float *level, float *facing, const float *point,
                           const float *normal, size_t room,
                           const align_pixel *picture,
                           const struct align_camera *camera);

/* s = sums over a keyframe's visibility (5,room); a and b only where asked for. */
typedef void align_sum_fn(struct align_sums *s, const float *visibility,
                          size_t room, const align_pixel *picture,
                          const struct align_camera *camera,
                          const struct align_residual *r, bool step);

/* s = sums over points moved by x (unknowns, a multiple of 4): gain, bias, and
 * how much of each direction; sigma as above. */
typedef void align_face_fn(struct align_face_sums *s,
                           const struct align_face_points *points,
                           const float *x, size_t unknowns,
                           const align_pixel *picture,
                           const struct align_camera *camera, float sigma);

struct align_kernels {
    align_picture_fn *picture;
    align_show_fn *show;
    align_sum_fn *sum;
    align_face_fn *face;
};

ISA_VERSIONS(const struct align_kernels, align_kernels);

#endif
