/* A set of Gaussians as plain arrays: what scene files hold and the renderer
 * draws. */
#ifndef SPID_BASE_GAUSSIANS_H
#define SPID_BASE_GAUSSIANS_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/half.h"

#define GAUSSIAN_SH0 0.28209479177387814      /* Y_0^0: files' colours */

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
    const float *reach;           /* (N) head units: the distance from
                                   * source_mean at which seen falls to 0; negative: the same,
                                   * movement up (+y) not counted; 0, or NULL
                                   * for all: seen stays as it is */
    const float *source_mean;     /* (N,3) centres in the photograph's pose;
                                   * NULL: mean */
    const float *normal;          /* (N,3) out of the surface in the
                                   * photograph's pose, head frame; 0 where no
                                   * light is known; NULL: nowhere */
    float light[3];               /* l on the photograph, head frame; with
                                   * normal */
    const float *around;          /* (N,2) place in the picture of the grain
                                   * (lib/avatar/grain.h), 0..1 across, or
                                   * under -1: none; NULL: nowhere */
    const float *tilt;            /* (N,2) how the depth that the source's
                                   * camera saw there rises to the picture's
                                   * right and down; NULL: nowhere */
};

/* Channel k of a Gaussian's colour, or the last one where there are fewer. */
static inline float gaussians_channel(const struct gaussians *g, size_t i,
                                      size_t k)
{
    const size_t c = (size_t)g->channels, at = c * i + (k < c ? k : c - 1);

    return g->color ? g->color[at] : half_to_float(g->color_half[at]);
}

/* How many times the surface that the photograph shows of a Gaussian a frame
 * shows, to first order in depth's slope.
 *   tilt (2)    how depth rises at it to the photograph's right and down, less
 *               where its place is sure (dynamic_branch_tilt)
 *   toward (2)  how far right and down the frame's camera is of the source's,
 *               sines (splat_place_view) */
static inline float gaussian_more(const float tilt[2], const float toward[2])
{
    return 1 + tilt[0] * toward[0] + tilt[1] * toward[1];
}

/* How much of what the photograph shows of a Gaussian a frame shows, 0..1, by
 * gaussian_more.  If that is far more, the photograph would be drawn out:
 * confidence is whole up to the first two figures' ratio and falls to 0 at the
 * second's.  If far less, the surface has turned its side, and its outline is
 * not the photograph's: the same down to the last two.  Chosen on validation
 * people by tests/bench/turned.sh figures, as it is and with -t 0,15,30,45 from
 * the front, and by eye. */
#define GAUSSIAN_DRAWN 0.75f
#define GAUSSIAN_TORN 0.4f
#define GAUSSIAN_ROTATED 0.3f
#define GAUSSIAN_GONE 0.05f
static inline float gaussian_visible(float more)
{
    const float drawn = (1 / fmaxf(more, 1) - GAUSSIAN_TORN) /
                        (GAUSSIAN_DRAWN - GAUSSIAN_TORN);
    const float rotated = (more - GAUSSIAN_GONE) /
                         (GAUSSIAN_ROTATED - GAUSSIAN_GONE);

    return fmaxf(fminf(fminf(drawn, rotated), 1), 0);
}

/* The plane's Gaussians are a sheet that the photograph was taken from, with the
 * head going on behind it: drawn out, it would be shreds before that.  Their
 * opacity is halved GAUSSIAN_THIN times for each time more of the surface that
 * a frame shows, from where confidence begins to fall; it is less than 1/255
 * where none is left. */
#define GAUSSIAN_THIN (8 / (1 / GAUSSIAN_TORN - 1 / GAUSSIAN_DRAWN))

/* GAUSSIAN_THIN of a Gaussian of the plane that the photograph shows; 0. */
static inline float gaussians_thin(const struct gaussians *g, size_t i)
{
    const bool plane = g->branch && g->branch[i] == 1;

    return plane && g->seen && g->seen[i] > 0 ? GAUSSIAN_THIN : 0;
}

/* By how many halves the opacity of a Gaussian falls. */
static inline float gaussian_halved(float thin, float more)
{
    return thin * fmaxf(more - 1 / GAUSSIAN_DRAWN, 0);
}

/* seen of a Gaussian that has moved from source_mean (3) to mean (3): unchanged
 * up to a third of its reach, 0 from its reach on. */
static inline float gaussian_seen(float seen, float reach,
                                  const float source_mean[3],
                                  const float mean[3])
{
    float square = 0, t;

    if (reach == 0)
        return seen;
    for (int k = 0; k < 3; k++) {
        const float way = mean[k] - source_mean[k];

        if (k != 1 || reach > 0 || way < 0)
            square += way * way;
    }
    t = 1.5f * (1 - sqrtf(square) / fabsf(reach));
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    return seen * t * t * (3 - 2 * t);
}

/* The same of Gaussian i of g, where it is now. */
static inline float gaussians_seen(const struct gaussians *g, size_t i)
{
    if (!g->seen || !g->reach || !g->source_mean)
        return g->seen ? g->seen[i] : 0;
    return gaussian_seen(g->seen[i], g->reach[i], g->source_mean + 3 * i,
                         g->mean + 3 * i);
}

/* Light on a surface of normal n (3), 1 the mean, by l (3) at most 1 long; never so
 * little that what l is off by is multiplied with it: chosen on validation,
 * tests/bench/README.md, "Light on a head that turns". */
#define GAUSSIAN_SHADOW 0.4f
static inline float gaussian_light(const float n[3], const float l[3])
{
    return fmaxf(1 + n[0] * l[0] + n[1] * l[1] + n[2] * l[2],
                 GAUSSIAN_SHADOW);
}

#endif
