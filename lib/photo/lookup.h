/* Inside lib/photo: the constants of a lookup, which its backward shares. */
#ifndef SPID_PHOTO_LOOKUP_H
#define SPID_PHOTO_LOOKUP_H

#include <math.h>

#include "lib/photo/texture.h"

/* A pixel with this blended weight or less has no place in the photograph, and with
 * the other in the grain, either: of a tenth of coverage nobody sees it. */
#define TEXTURE_MIN 0.004f
#define TEXTURE_GRAIN_MIN (0.1f * SPLAT_PLACE_GRAIN)
/* The confidence by the share of the coverage that has a place: whole from
 * three quarters on, since along an outline some of the coverage never has
 * one. */
#define TEXTURE_SHARE(share) (((share) - SPLAT_PLACE_SLIGHT) / \
                              (0.75f - SPLAT_PLACE_SLIGHT))

/* How much of the grain a pixel has by the share of the coverage that has a place:
 * all where that share is the grain's.  Where it is less, places of the grain are
 * mixed with none, and where it is more, with places of the photograph: there is
 * no such place. */
#define TEXTURE_GRAIN(share) \
    (5 * (share) / SPLAT_PLACE_GRAIN - 4)
#define TEXTURE_GRAIN_NO_MORE(share) \
    (5 - 10.0f / 3 * (share) / SPLAT_PLACE_GRAIN)

/* How many times its coverage the confidence in a pixel may be.  Where a head has
 * turned its outline is its Gaussians' and not the photograph's, and a pixel
 * that their tails reach shows as little of it; where it has not, the
 * photograph's matte is finer than they are: TEXTURE_COVER at a right angle,
 * four at 20 degrees.  By eye on validation people of the London set at 20 and
 * 35 degrees; on frames that turn little it changes nothing (reenact.sh). */
#define TEXTURE_COVER 1.4f
static inline float texture_cover(const struct splat_place_view *v)
{
    return TEXTURE_COVER / fmaxf(sqrtf(v->toward[0] * v->toward[0] +
                                       v->toward[1] * v->toward[1]), 1e-3f);
}

/* Where the photograph shows nobody, a head that has turned is there all the same if
 * its Gaussians cover the pixel: the mesh may be wider than the person, which in the
 * photograph is beside its outline, but after a turn a hole in a neck.  So confidence
 * is times 1 - (1 - matte) texture_turn TEXTURE_SOLID: from 20 degrees on, not of
 * shoulders, which do not turn, below where the neck ends, nor where what is about
 * an outline covers a pixel in part.  tests/bench/README.md, "Holes, shreds and
 * outlines". */
#define TEXTURE_TURN 0.35f      /* sine of the turn */
#define TEXTURE_OPAQUE 0.9f     /* coverage up to which a pixel is covered in part */
#define TEXTURE_SOLID(alpha) (((alpha) - TEXTURE_OPAQUE) / (1 - TEXTURE_OPAQUE))
static inline float texture_turn(const struct splat_place_view *v)
{
    const float *d = v->toward;

    return fminf(sqrtf(d[0] * d[0] + d[1] * d[1]) / TEXTURE_TURN, 1);
}

/* Which level of t a picture of size by size pixels is looked up in. */
size_t texture_level(const struct texture *t, const struct splat_place_view *v,
                     size_t size);

/* A field with places `step` pixels apart on photo (n,5), pixels from x on in row
 * y of a picture that has color (n,3) and alpha (n) itself. */
void texture_field_row(float *photo, const float *color, const float *alpha,
                       const struct texture_field *f, float step, size_t x,
                       size_t n, size_t y);

#endif
