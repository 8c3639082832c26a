/* Inside lib/photo: the constants of a lookup, which its backward shares. */
#ifndef SPID_PHOTO_LOOKUP_H
#define SPID_PHOTO_LOOKUP_H

#include "lib/photo/texture.h"

/* A pixel with this blended weight or less has no place. */
#define TEXTURE_LEAST 0.004f
/* Change of the offset from pixel to pixel, in pixels: the confidence falls
 * from the one on and is 0 from the other on. */
#define TEXTURE_JUMP 1.5f
#define TEXTURE_LEAP 6.0f
/* Area of the photograph that a pixel shows, over that of the view: the
 * confidence is whole from the one on and 0 below the other, or a cheek that
 * the photograph shows from the side would be its stretched outline when seen
 * from the front.  Measured over so many pixels to either side. */
#define TEXTURE_SHARP 0.55f
#define TEXTURE_STRETCHED 0.12f
#define TEXTURE_ACROSS 3
/* An outline is softer than a picture's side over this nowhere. */
#define TEXTURE_SOFT 86
/* The confidence by the share of the coverage that has a place: whole from
 * three quarters on, since along an outline some of the coverage never has
 * one. */
#define TEXTURE_SHARE(share) (1.6f * (share) - 0.2f)

/* Which level of t a picture of size by size pixels is looked up in. */
size_t texture_level(const struct texture *t, const struct splat_place_view *v,
                     size_t size);

/* What the view enlarges by, without its turn: A's smaller singular value,
 * squared. */
float texture_zoom(const struct splat_place_view *v);
/* Factor of the confidence, under 1 where the places around pixel (x,y), which
 * has one, stretch the photograph or fold it.  A constant for the backward. */
float texture_stretch(const float *place, const struct splat_place_view *v,
                      float zoom, size_t x, size_t y, size_t size);

/* Confidence in the photograph at rims, by how far the head has turned
 * since the source (turns in the picture's plane do not count). */
struct texture_rim {
    float turned;       /* 0 up to 12 degrees, 1 from 25 on: how much rims, of
                         * little matte or coverage, are doubted */
    float least;        /* 0 up to 6 degrees, 1 from 12 on: how much rims of
                         * the source that lie inside the drawn head are
                         * doubted and filled; they would be slits */
    float inner;        /* the same well inside the drawn head: 0 up to 3
                         * degrees, 1 from 8 on */
    float still;        /* 1 at 0 degrees, 0 from 3 on: how much the
                         * photograph is believed where it shows nobody */
    float most;         /* the photograph covers at most so many times what is
                         * drawn: without limit at 0 degrees, 2 from 8 on.  Past
                         * an outline lie places from anywhere beyond it */
};
/* Of the view to a frame. */
struct texture_rim texture_rim(const struct splat_place_view *v);
/* The least drawn coverage alpha (size,size) to either side, above and below
 * pixel (x,y), farther away than an outline is soft. */
float texture_inside(const float *alpha, size_t x, size_t y, size_t size);
/* rim at a pixel of that texture_inside: well inside the drawn head, where no
 * hair is thin, what the source shows as a rim is doubted sooner.  A constant
 * for the backward. */
static inline struct texture_rim texture_rim_at(struct texture_rim rim,
                                                float inside)
{
    const float solid = (inside - 0.8f) / 0.15f;
    const float least = rim.inner * (solid > 0 ? solid < 1 ? solid : 1 : 0);

    rim.least = least > rim.least ? least : rim.least;
    return rim;
}
/* Factor of the confidence by matte and drawn coverage alpha: less where either
 * is less than full, or the matte less than the coverage, as there a turned
 * head's rim is torn.  The matte's share of the coverage counts by its fourth
 * power; by the share alone a quarter of the background would shine through
 * what is drawn solid. */
static inline float texture_whole(float matte, float alpha,
                                  struct texture_rim rim)
{
    const float whole = 0.95f * (2 * alpha - 1);
    float t = ((matte < alpha ? matte : alpha) - 0.5f) / 0.45f;

    t = t > 0 ? t < 1 ? t : 1 : 0;      /* fminf would be a call */
    t = 1 - rim.turned * (1 - t);
    if (!(matte < whole))
        return t;
    const float share = matte * matte / (whole * whole);
    return t * (1 - rim.least * (1 - share * share));
}

/* The confidence in a pixel of that matte, from the share and the smoothness of
 * its places: times texture_whole, and more on a head that has not turned where
 * the photograph shows nobody: the tails of Gaussians beside hair. */
static inline float texture_sure(float sure, float matte, float alpha,
                                 struct texture_rim rim)
{
    const float nobody = 1 - 255 * matte;

    sure *= texture_whole(matte, alpha, rim);
    if (!(nobody > 0))
        return sure;
    const float more = 3 * sure;
    return sure + rim.still * nobody * (more < 1 ? more : 1) * (1 - sure);
}

/* Factor of a looked-up pixel's colours and matte.  They cover at most rim.most
 * times the drawn coverage alpha.  On a turned head a matte below alpha is the
 * old outline's: there they cover as much as is drawn, but at most twice what
 * they did, as the colour is not known where the matte is small. */
static inline float texture_cover(float matte, float alpha,
                                  struct texture_rim rim)
{
    if (matte > rim.most * alpha)
        return rim.most * alpha / matte;
    if (!(matte < alpha))
        return 1;
    return 1 + rim.least * (alpha < 2 * matte ? alpha / matte - 1 : 1);
}

/* Apply a field with places `step` pixels apart to photo (n,5), pixels from x
 * on in row y: confidence times 1 - doubt, colours times 1 + gain. */
void texture_field_row(float *photo, const struct texture_field *f,
                       float step, size_t x, size_t n, size_t y);

#endif
