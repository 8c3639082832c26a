/* Gaussians to pixels and back: the paper's Eq. C, forward and backward.
 *
 * Order of calls:  splat_init; splat_load (once per set of Gaussians);
 * then per frame splat_update (what moved) and splat_forward; for training
 * splat_backward after splat_forward.  Images are (H, W, C), row-major.
 * Same bytes for every thread count.  Errors: 0, or -1 and *err. */
#ifndef SPID_SPLAT_SPLAT_H
#define SPID_SPLAT_SPLAT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/cpu.h"
#include "lib/base/error.h"

#define SPLAT_MAX_CHANNELS 32
#define SPLAT_COLORS 4            /* more channels are features: unless asked
                                   * otherwise, products of 16 bits, and half
                                   * precision on the way to the refiner */
#define SPLAT_MAX_SIZE 16384      /* pixels along one side */

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
};

/* x_cam = R x + t, x right, y down, z forward; pixel = f x/z + c, the centre
 * of pixel i at i + 0.5. */
struct splat_camera {
    float rt[12];                 /* (3,4) rows of [R|t] */
    float fx, fy;                 /* focal lengths, pixels */
    float cx, cy;                 /* principal point, pixels */
};

/* Camera of a picture of size x size: f = focal * size / 2 (focal 12 in
 * design.md), centre size / 2. */
struct splat_camera splat_camera_square(const float rt[12], int size,
                                        float focal);

enum splat_rules {
    SPLAT_GSPLAT,   /* quaternions normalised; alpha = min(0.99, o e^-s);
                     * skipped under alpha_cut; dropped with all behind it
                     * when T (1 - alpha) <= t_cut; near plane z > 0.01 */
    SPLAT_DGR,      /* as the public CUDA rasteriser: quaternions as they
                     * are, whole 16x16 tiles at 3 sigma, near plane 0.2 */
    SPLAT_EXACT     /* no clamp, no cut-offs, near plane 0.01: double only */
};

struct splat_options {
    int width, height;
    int channels;                 /* drawn: the first 1..32 of the colours */
    enum splat_rules rules;       /* GSPLAT or DGR for the fast kernels */
    int threads;                  /* 0: what OpenMP gives */
    float near;                   /* drawn if z > near; 0: as the rules say */
    float alpha_cut;              /* default 1/255; at least 2^-24 */
    float t_cut;                  /* default 1e-4; 0: no early stop */
    int exp_degree;               /* of the exp2 polynomial: 3 (relative error
                                   * 7.5e-5), 2 (1.7e-3), 4 (2.6e-6) or 5
                                   * (float's rounding); default 0: 3, and 5
                                   * with gradients */
    bool fixed16;                 /* over 4 channels: Q15 products where the
                                   * processor has them; not with gradients */
    bool depth;                   /* splat_forward may be asked for depth */
    bool covered;                 /* splat_forward_half may leave pixels of
                                   * alpha 0 as they were, not write zeros */
    bool gradients;               /* splat_backward will be called */
    float prune;                  /* Gaussians of a lower opacity are left
                                   * out; default 0: none.  Each changes a
                                   * pixel by less than this times the range
                                   * of the colours */
    bool level_set;               /* for measuring: kernels of `level`, which */
    enum cpu_level level;         /* the processor must have, not the best */
    unsigned branches;            /* bit b set: branch b is drawn; 0: all */
};

/* Defaults for a picture of that size. */
struct splat_options splat_defaults(int width, int height, int channels);

struct splat_state;

/* What a frame is made of, for measuring. */
enum splat_phase { SPLAT_PROJECT, SPLAT_SORT, SPLAT_BIN, SPLAT_DRAW,
                   SPLAT_PHASES };

/* A renderer: its options, and all its memory. */
struct splat {
    struct splat_options opt;     /* read-only after splat_init */
    size_t n;                     /* Gaussians loaded */
    size_t drawn, pairs;          /* of the last frame: Gaussians on screen,
                                   * (tile, Gaussian) pairs */
    double ms[SPLAT_PHASES];      /* of the last frame: milliseconds */
    size_t bytes;                 /* of memory it holds, gradients apart */
    struct splat_state *state;
};

/* Check the options and make the renderer.  EX_USAGE names the option that is
 * out of range and what would do. */
int splat_init(struct splat *s, const struct splat_options *opt,
               struct error *err);
void splat_release(struct splat *s);   /* of a zeroed *s: nothing */

/* Take over a set of Gaussians (copied and packed; g may go away after the
 * call).  N may be 0.  EX_DATAERR with array and index on a number that is
 * not finite, a negative scale, an opacity outside [0,1]. */
int splat_load(struct splat *s, const struct gaussians *g,
               struct error *err);

/* New centres for Gaussians first .. first + count - 1; mean is (count,3).
 * Nothing else is touched, and only these are projected again if the camera
 * stays.  EX_DATAERR when out of range or not finite. */
int splat_update(struct splat *s, const float *mean, size_t first,
                 size_t count, struct error *err);

/* Move Gaussians first .. by one vector (the mouth sheet's shift), relative
 * to their loaded centres. */
int splat_shift(struct splat *s, const float shift[3], size_t first,
                size_t count, struct error *err);

/* Draw.
 *   image (H,W,C) out  sum_i c_i w_i + T background, sRGB values for the
 *                      first three channels
 *   alpha (H,W)   out  1 - T, or NULL
 *   depth (H,W)   out  sum_i w_i z_i / sum_i w_i, camera z in head units, 0
 *                      where nothing is; NULL unless opt.depth
 *   background (C) in  or NULL: zeros
 * EX_DATAERR on a camera that is not finite, a singular R, a focal <= 0. */
int splat_forward(struct splat *s, float *image, float *alpha, float *depth,
                  const struct splat_camera *cam, const float *background,
                  struct error *err);

/* The same with a half-precision image. */
int splat_forward_half(struct splat *s, uint16_t *image, float *alpha,
                       float *depth, const struct splat_camera *cam,
                       const float *background, struct error *err);

/* Where splat_backward adds its results; each may be NULL. */
struct splat_gradients {
    float *mean;                  /* (N,3) */
    float *scale;                 /* (N,3) */
    float *quat;                  /* (N,4) of the quaternion as given */
    float *opacity;               /* (N) */
    float *color;                 /* (N,C), C of splat_options */
    float *rt;                    /* (3,4) of the camera's [R|t], entry by
                                   * entry (R taken as nine free numbers) */
};

/* Gradients of a loss from those of the picture drawn by the last
 * splat_forward with opt.gradients set.
 *   d_image (H,W,C) in  dL/dimage
 *   d_alpha (H,W)   in  dL/dalpha, or NULL
 * Adds into g.  No gradient where the 0.99 clamp is active.  Sums run in a
 * fixed order: same bits for every thread count. */
int splat_backward(struct splat *s, const struct splat_gradients *g,
                   const float *d_image, const float *d_alpha,
                   struct error *err);

#endif
