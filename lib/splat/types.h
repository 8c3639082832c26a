/* What a renderer is given and what it is: Gaussians, camera, options.  The
 * layer that all of lib/splat stands on; splat.h has what can be done with
 * it. */
#ifndef SPID_SPLAT_TYPES_H
#define SPID_SPLAT_TYPES_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/cpu.h"
#include "lib/base/error.h"
#include "lib/base/gaussians.h"

#define SPLAT_MAX_CHANNELS 32
#define SPLAT_COLORS 4            /* more channels are features: unless asked
                                   * otherwise, products of 16 bits, and half
                                   * precision on the way to the refiner */
#define SPLAT_MAX_SIZE 16384      /* pixels along one side */

/* x_cam = R x + t, x right, y down, z forward; pixel = f x/z + c, the centre
 * of pixel i at i + 0.5. */
struct splat_camera {
    float rt[12];                 /* (3,4) rows of [R|t] */
    float fx, fy;                 /* focal lengths, pixels */
    float cx, cy;                 /* principal point, pixels */
};

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
    int threads;                  /* for which the steps before drawing are
                                   * cut; 0: parallel_width() */
    float near;                   /* drawn if z > near; 0: as the rules say */
    float alpha_cut;              /* default 1/255; at least 2^-24 */
    float t_cut;                  /* default 1e-4; 0: no early stop */
    int exp_degree;               /* of the exp2 polynomial: 3 (relative error
                                   * 7.5e-5), 2 (1.7e-3), 4 (2.6e-6) or 5
                                   * (float's rounding); default 0: 3, and 5
                                   * with gradients */
    bool fixed16;                 /* over 4 channels: Q15 products where the
                                   * processor has them; not with gradients */
    bool depth;                   /* splat_draw may be asked for depth */
    bool covered;                 /* splat_draw may leave pixels of
                                   * alpha 0 as they were, not write zeros */
    bool kept;                    /* whoever has the pictures leaves pixels of
                                   * alpha 0 as they are: parts where nothing
                                   * is, nor was in the last frame into the
                                   * same pictures, are not written again */
    bool gradients;               /* splat_backward will be called */
    float prune;                  /* Gaussians of a lower opacity are left
                                   * out; default 0: none.  Each changes a
                                   * pixel by less than this times the range
                                   * of the colours */
    bool level_set;               /* for measuring: kernels of `level`, which */
    enum cpu_level level;         /* the processor must have, not the best */
    bool place;                   /* places in the source picture may be asked
                                   * for (splat_draw) */
    unsigned branches;            /* bit b set: branch b is drawn; 0: all */
};

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

/* How places in the driven picture become places in the source picture, but for
 * each Gaussian's own surface: M(x), which is A x + b on a plane that faces the
 * source's camera, positions from -1 to 1 across a picture.  On a surface whose
 * depth rises otherwise a step is shorter by the share s (splat_place_shorter) along
 * e (2), a unit vector, so that the Gaussian centred at x has what the frame shows
 * at y at
 *   2 uv - 1 + (1 - s e e^T) (M(y) - M(x)).
 * Its place channels, of which y is not part and which are blended, are
 *   c (2 uv - 1 - M(x) + s e e^T M(x)), x before y; c; c s,
 * c being the confidence in it: seen times gaussian_visible.
 *
 * A Gaussian that has a place in the grain, too (gaussians.h), adds the same of that
 * with splat_place_grain for c and splat_place_unrolled for s: so little that where
 * there is confidence in places of the photograph they are the photograph's. */
#define SPLAT_PLACE_CHANNELS 4
#define SPLAT_PLACE_GRAIN (1.0f / 4096)
#define SPLAT_PLACE_NOWHERE (-3.0f)     /* places under that are none */
#define SPLAT_PLACE_SLIGHT 0.125f       /* confidence under which a pixel shows
                                         * none of the photograph */
struct splat_place_view {
    float A[4];                   /* rows */
    float b[2];
    float shoulders[6];           /* what A and b change by for the shoulders,
                                   * which do not turn with the head, and */
    float neck[3];                /* their share at (x,y), from 0 to 1: neck[0] x
                                   * + neck[1] y + neck[2] */
    float toward[2];              /* where this frame's camera is, seen from the
                                   * head along the source camera's axes: sines
                                   * to the right and down (gaussian_visible) */
};
#define SPLAT_PLACE_VIEW 17     /* numbers of it */

/* Determinants are at least this, surfaces seen at no less than 20 degrees: maps
 * would grow without bound. */
#define SPLAT_PLACE_STEEPEST 0.35f

/* The direction of `toward`, or 0 (2), and the cosine between the cameras. */
struct splat_place_side {
    float e[2], facing;
};

static inline struct splat_place_side
splat_place_side(const struct splat_place_view *v)
{
    const float *t = v->toward, square = t[0] * t[0] + t[1] * t[1];
    const float by = square > 0 ? 1 / sqrtf(square) : 0;

    return (struct splat_place_side){
        {t[0] * by, t[1] * by},
        fmaxf(sqrtf(fmaxf(1 - square, 0)), SPLAT_PLACE_STEEPEST)};
}

/* s, from how far the depth rises toward the frame's camera: tilt . toward. */
static inline float splat_place_shorter(float rise, float facing)
{
    return rise / fmaxf(facing + rise, SPLAT_PLACE_STEEPEST);
}

/* The weight of a place in the grain by the confidence in the photograph's. */
static inline float splat_place_grain(float confidence)
{
    return SPLAT_PLACE_GRAIN * fmaxf(1 - confidence / SPLAT_PLACE_SLIGHT, 0);
}

/* s on the grain, which is as long as the surface and not as the photograph shows
 * it: by normal n (3) in the frame of a head that [R|t] rt (3,4) sees, upright, as
 * the grain is unrolled; 0 of n 0. */
static inline float splat_place_unrolled(const float n[3], const float rt[12],
                                         float facing)
{
    float across = 0, toward = 0;

    for (int k = 0; k < 3; k++) {
        across += n[k] * rt[k];
        toward -= n[k] * rt[8 + k];
    }
    const float length = sqrtf(across * across + toward * toward);

    return length > 0 ? 1 - facing / fmaxf(toward / length,
                                           SPLAT_PLACE_STEEPEST) : 0;
}

/* at (2): where the view takes a frame's (x,y). */
static inline void splat_place_at(double at[2],
                                  const struct splat_place_view *v, double x,
                                  double y)
{
    const float *A = v->A, *S = v->shoulders, *n = v->neck;
    const double share = fmin(fmax(n[0] * x + n[1] * y + n[2], 0), 1);

    for (int k = 0; k < 2; k++)
        at[k] = A[2 * k] * x + A[2 * k + 1] * y + v->b[k] +
                share * (S[2 * k] * x + S[2 * k + 1] * y + S[4 + k]);
}

/* at (2), M(y), becomes the place that was blended there: p, the channels. */
static inline void splat_place_blended(double at[2],
                                       const struct splat_place_side *side,
                                       const float p[SPLAT_PLACE_CHANNELS])
{
    const float *e = side->e;
    const double along = p[3] * (e[0] * at[0] + e[1] * at[1]);

    for (int k = 0; k < 2; k++)
        at[k] += (p[k] - along * e[k]) / p[2];
}

/* J (2,2): how M moves with x and y. */
static inline void splat_place_slope(double J[4],
                                     const struct splat_place_view *v,
                                     double x, double y)
{
    const float *S = v->shoulders, *n = v->neck;
    const double share = n[0] * x + n[1] * y + n[2];

    for (int k = 0; k < 4; k++) {
        const float *row = S + k / 2 * 2;
        const double more = row[0] * x + row[1] * y + S[4 + k / 2];

        J[k] = v->A[k] + (share >= 1 ? S[k] : share > 0
                                  ? share * S[k] + more * n[k % 2] : 0);
    }
}

/* What becomes of n <= 16 finished pixels of row y, from x on: color (n,C) and
 * alpha (n) in place in their pictures, by the blended places, place (n,4).
 * color is NULL in half precision.  Any thread calls it. */
typedef void splat_shade_fn(void *ctx, float *color, float *alpha,
                            const float *place, int x, int y, int n);

/* Where a frame goes; what is NULL is not drawn, but for image and half, of
 * which there is one. */
struct splat_pictures {
    float *image;                 /* (H,W,C) or ... */
    uint16_t *half;               /* ... the same in half precision */
    float *alpha;                 /* (H,W) 1 - T */
    float *depth;                 /* (H,W) with opt.depth */
    float *place;                 /* (H,W,4) with opt.place: sum_i w_i of the
                                   * place channels, always in float */
    splat_shade_fn *shade;        /* with opt.place and alpha */
    void *ctx;                    /* its first argument */
};

/* A loss's gradients of them; all but image may be NULL. */
struct splat_picture_gradients {
    const float *image, *alpha, *place;
};

/* Where splat_backward adds its results; each may be NULL. */
struct splat_gradients {
    float *mean;                  /* (N,3) */
    float *scale;                 /* (N,3) */
    float *quat;                  /* (N,4) of the quaternion as given */
    float *opacity;               /* (N) */
    float *color;                 /* (N,C), C of splat_options */
    float *rt;                    /* (3,4) of the camera's [R|t], entry by
                                   * entry (R taken as nine free numbers) */
    float *place;                 /* (N,4) of the place channels */
};

#endif
