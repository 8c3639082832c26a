/* How the light on a head changes as it turns under it: what the photograph's
 * colours are to be multiplied by, as a picture a quarter of the size.
 *
 * A light that stays before the camera falls on a turned head from elsewhere
 * (relative_light), and another lamp can be in its place.  Of a surface of normal n a
 * frame shows gaussian_light(n, l now) / gaussian_light(n, l) times the light that
 * the photograph shows, times the lamp's brightness; sRGB
 * goes with its square root (a gamma of 2).  Shadows that a face throws on itself,
 * and shine, are not part of it.  Ours, not the paper's. */
#ifndef SPID_SPLAT_RELIGHT_H
#define SPID_SPLAT_RELIGHT_H

#include "lib/base/relative_pose.h"
#include "lib/splat/types.h"

#define RELIGHT_STEP 4          /* pixels from one number to the next */

static inline size_t relight_side(size_t pixels)
{
    return (pixels + RELIGHT_STEP - 1) / RELIGHT_STEP;
}

/* Floats that splat_relight works in: two pictures, and what the filters see of
 * one, with two lines about it. */
#define RELIGHT_ROOM(h, w) (2 * (h) * (w) + ((h) + 5) * ((w) + 4))

/* gain (relight_side(H),relight_side(W)) of the frame that splat_draw drew last;
 * light: the lamp by relative_light; tint (3): by how much more its colours are
 * multiplied everywhere, the roots of its brightness.  Each place has the mean of the
 * foremost Gaussians whose centres lie in it, blurred over its neighbours; 1
 * where there are none.  With opt.place only. */
void splat_relight(float *gain, float tint[3], struct splat *s,
                   const float light[LAMP_SIZE]);
/* Whether it changes anything. */
static inline bool relight_tinted(const float tint[3])
{
    return tint[0] != 1 || tint[1] != 1 || tint[2] != 1;
}

/* color (height,width,channels: the first three, premultiplied) times the
 * gain (relight_side(from) a side) of a picture of `from` pixels a side that it
 * may have been enlarged from, and tint (3; NULL: 1); at most alpha (height,width;
 * NULL: anything). */
void relight_apply(float *color, size_t channels, const float *alpha,
                   const float *gain, const float *tint, size_t from,
                   size_t height, size_t width);
/* Back through relight_apply with from pixels a side, color (from,from,channels)
 * what came out: dcolor in place, dalpha (from,from) += where it was cut off. */
void relight_apply_backward(float *dcolor, float *dalpha, const float *color,
                            size_t channels, const float *alpha,
                            const float *gain, size_t from);

#endif
