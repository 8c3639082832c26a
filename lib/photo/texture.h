/* The photograph as texture.  Decoded colours are soft; the source picture is
 * not.  Each Gaussian knows its place in the source picture
 * (place.h), the renderer blends places as it blends colours, and each pixel
 * then takes its colour from the photograph at the blended place: deferred
 * texturing, after Deering et al. 1988 ("The triangle processor and normal
 * vector shader") and image-based rendering since.
 *
 * What is looked up is the person alone: colours without their background and
 * multiplied by the matte, so that they compose over any other background,
 * and interpolated, without a rim of the old one (Porter and Duff 1984). */
#ifndef SPID_PHOTO_TEXTURE_H
#define SPID_PHOTO_TEXTURE_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/splat/types.h"
#include "lib/stream/stream.h"

#define TEXTURE_LEVELS 6        /* at most */

/* Numbers of a looked-up pixel: red, green, blue, matte (premultiplied,
 * 0..1) and the confidence in them, 0..1. */
#define TEXTURE_PHOTO 5

struct texture {
    size_t levels;
    size_t side[TEXTURE_LEVELS];        /* pixels: the picture's, then the
                                         * powers of two below it */
    uint8_t *level[TEXTURE_LEVELS];     /* (side, side, 4) premultiplied red,
                                         * green, blue, matte */
    uint8_t *block;             /* what they are parts of */
    const uint8_t *grain;       /* (grain_size,grain_size) GAUS's, the caller's,
                                 * or NULL: none */
    size_t grain_size;
};

/* Of a source picture rgb (S,S,3), its matte (S,S) and the background that
 * the person hides, back (S,S,3): person = rgb - (1 - matte) back.  EX_OSERR
 * without memory, EX_DATAERR if S is less than 2. */
int texture_init(struct texture *t, const uint8_t *rgb, const uint8_t *matte,
                 const uint8_t *back, size_t S, struct error *err);
/* Of a stream's source photograph in place of the last one; of a record without
 * background none.  Further pictures of the person change nothing.  -1 when the
 * record is damaged, and as above. */
int texture_read_record(struct texture *t, const struct record *srci,
                        struct error *err);
/* Free what it holds; zeroed then. */
void texture_release(struct texture *t);

/* The person's colours themselves, out (n,3): what rgb would show without the
 * background, rgb where the matte is 0. */
void texture_straight(uint8_t *out, const uint8_t *rgb, const uint8_t *matte,
                      const uint8_t *back, size_t n);

/* The photograph while a picture is drawn (splat_pictures): each pixel is looked
 * up as soon as its place is known, and nothing is read again. */
struct texture_shader {
    const struct texture *t;
    size_t level, size;         /* of the picture: size by size pixels */
    struct splat_place_view view;
    struct splat_place_side side;       /* of the view */
    float *photo;               /* (size,size,5) what is looked up; NULL: it is
                                 * mixed into colours and alpha (texture_mix) */
    size_t channels;            /* of these colours */
};
void texture_shader_init(struct texture_shader *s, const struct texture *t,
                         const struct splat_place_view *v, size_t size,
                         float *photo, size_t channels);
splat_shade_fn texture_shade;   /* ctx: a struct texture_shader */

/* photo (size,size,5) of a picture of size by size pixels.
 *   place (size,size,4)  the blended places (place.h)
 *   alpha (size,size)    coverage
 * A pixel that no Gaussian with a place covers gets zeros, and one that only places
 * in the grain cover what multiplies its colours by it, g: black, its own alpha and
 * a confidence of 1 - g, which may be negative.  The confidence is
 * the blended one's share of the coverage: how far the photograph is believed
 * is decided for each Gaussian (gaussian_visible); and it is little where there
 * is little of them, the less the further the head has turned. */
void texture_lookup(float *photo, const struct texture *t,
                    const struct splat_place_view *v, const float *place,
                    const float *alpha, size_t size);

/* Colour = confidence x photograph + (1 - confidence) x colour, alpha likewise:
 * n pixels of color (n,channels: the first three, premultiplied) and alpha
 * (n), in place. */
void texture_mix(float *color, size_t channels, float *alpha,
                 const float *photo, size_t n);

/* What a refiner says of the photograph, a quarter of the picture's size and
 * linear between: doubt, and gains of red, green and blue. */
#define TEXTURE_FIELD 4         /* numbers of a place of it */
#define TEXTURE_FIELD_STEP 4    /* pixels from one place to the next */

struct texture_field {
    const float *at;            /* (height,width,4), or NULL: zeros */
    size_t height, width;
};

/* The mixture of a whole picture, with a field: rgb (height,width,3) and alpha
 * (height,width) in place, photo (height,width,5).  With m = min(alpha, matte) and
 * doubt within 0..1 a pixel becomes
 *   rgb + confidence (q - rgb), within 0 and the alpha it ends with,
 *   q = photograph (1 + gain) (1 - doubt m / matte) + rgb doubt m / alpha:
 * what is doubted is how the photograph looks where the picture has something of
 * its own, not what it covers. */
void texture_compose(float *rgb, float *alpha, const float *photo,
                     const struct texture_field *field, size_t height,
                     size_t width);

/* Back through texture_compose: drgb and dalpha in place, dphoto and dfield
 * are written.  rgb and alpha are what went in. */
void texture_compose_backward(float *drgb, float *dalpha, float *dphoto,
                              float *dfield, const float *rgb,
                              const float *alpha, const float *photo,
                              const struct texture_field *field,
                              size_t height, size_t width);

/* dplace (size,size,4) and dalpha (size,size) += the gradient of dphoto
 * (size,size,5), what texture_lookup gave.  Constants are the view and the
 * level. */
void texture_lookup_backward(float *dplace, float *dalpha,
                             const float *dphoto, const struct texture *t,
                             const struct splat_place_view *v,
                             const float *place, const float *alpha,
                             size_t size);

/* No more light than alpha (n) lets through, and no less than none: color
 * (n,channels: the first three, premultiplied) within 0..alpha, in place.  A
 * refiner that adds to a picture may otherwise make the background shine, or
 * darken it. */
void texture_clamp_to_alpha(float *color, size_t channels, const float *alpha,
                            size_t n);

/* texture_lookup and texture_mix for a whole picture, without keeping what was
 * looked up: color (size,size,3) and alpha (size,size) in place.  With a field that
 * is not NULL texture_compose in texture_mix's place; its places lie `step` pixels
 * apart, in a picture that was enlarged since the refiner saw it. */
void texture_apply(float *color, float *alpha, const struct texture *t,
                   const struct splat_place_view *v, const float *place,
                   size_t size, const struct texture_field *field, float step);

#endif
