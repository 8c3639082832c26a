/* Inside lib/texture: the constants of a lookup, which its backward shares. */
#ifndef SPID_TEXTURE_LOOKUP_H
#define SPID_TEXTURE_LOOKUP_H

#include "lib/texture/texture.h"

/* Below this blended weight there is no place to speak of. */
#define TEXTURE_LEAST 0.004f
/* How a place may change from pixel to pixel, beside the view's own change,
 * before it is doubted, and when it is not believed at all. */
#define TEXTURE_JUMP 1.5f
#define TEXTURE_LEAP 6.0f
/* How many of the photograph's pixels a pixel must show to be believed, and
 * below how few it is not at all: a cheek seen from the side and now from the
 * front would be its outline, drawn out.  Measured across so many pixels. */
#define TEXTURE_SHARP 0.55f
#define TEXTURE_STRETCHED 0.12f
#define TEXTURE_ACROSS 3
/* The confidence by the share of the coverage that has a place.  Full from three
 * quarters on: along an outline a little of the coverage never has one, and
 * would stand beside the person where the photograph has nobody. */
#define TEXTURE_SHARE(share) (1.6f * (share) - 0.2f)

/* Which level of t a picture of size by size pixels is looked up in. */
size_t texture_level(const struct texture *t, const struct splat_place_view *v,
                     size_t size);

/* What the view enlarges by, without its turn: A's smaller singular value,
 * squared. */
float texture_zoom(const struct splat_place_view *v);
/* Less than 1 where the places about pixel (x,y), which has one, draw the
 * photograph out or fold it over.  The backward holds it. */
float texture_stretch(const float *place, const struct splat_place_view *v,
                      float zoom, size_t x, size_t y, size_t size);

/* How rims are believed, by how far a turned head's view is from the source's
 * but for scale and turns in the picture. */
struct texture_rim {
    float turned;       /* 0 at 12 degrees and less, 1 at 25 and more: rims are
                         * doubted */
    float least;        /* 0 at 6 degrees and less, 1 at 12 and more: so are
                         * those of the source that lie before what is drawn
                         * solid, and would be slits in it: closed, too */
    float most;         /* times the drawn coverage is the most that the
                         * photograph covers: any at 0 degrees, twice at 8 and
                         * more.  Past an outline lie places from anywhere
                         * beyond it. */
};
struct texture_rim texture_rim(const struct splat_place_view *v);
/* What of the confidence is left where the matte or the coverage alpha is less
 * than full, or the matte less than the coverage: there a turned head's rim is
 * torn.  The matte's share of the coverage counts by its fourth power: by the
 * share alone, a quarter of the background would shine through what is drawn
 * solid. */
static inline float texture_whole(float matte, float alpha,
                                  struct texture_rim rim)
{
    const float least = 0.95f * rim.least * (2 * alpha - 1);
    float t = ((matte < alpha ? matte : alpha) - 0.5f) / 0.45f;

    t = t > 0 ? t < 1 ? t : 1 : 0;      /* fminf would be a call */
    t = 1 - rim.turned * (1 - t);
    if (!(matte < least))
        return t;
    const float share = matte * matte / (least * least);
    return t * share * share;
}

/* What a looked-up pixel's colours and matte are multiplied by: they cover no
 * more than rim.most times the drawn coverage alpha; and on a turned head, to
 * whose old outline a matte below alpha belongs, as much as is drawn, but no
 * more than twice their own: a colour of little matte is not known. */
static inline float texture_cover(float matte, float alpha,
                                  struct texture_rim rim)
{
    if (matte > rim.most * alpha)
        return rim.most * alpha / matte;
    if (!(matte < alpha))
        return 1;
    return 1 + rim.least * (alpha < 2 * matte ? alpha / matte - 1 : 1);
}

/* photo (n,5) of pixels from x on in row y as a field with places `step`
 * pixels apart has it: less confidence by its doubt, colours by its gains. */
void texture_field_row(float *photo, const struct texture_field *f,
                       float step, size_t x, size_t n, size_t y);

#endif
