/* How the light on a head changes as it turns under it: what colours seen by
 * the photograph are to be multiplied by, as a picture a quarter of the size.
 *
 * A light that stays before the camera falls on a turned head from elsewhere:
 * l (3) of GAUS, turned back by the head's turn.  Of Gaussian i the frame shows
 * gaussian_light(n, l now) / gaussians_source_light times the photograph's
 * light; sRGB goes with its square root (a gamma of 2). */
#ifndef SPID_SPLAT_RELIGHT_H
#define SPID_SPLAT_RELIGHT_H

#include "lib/splat/types.h"

#define RELIGHT_STEP 4            /* pixels from one number to the next */

static inline size_t relight_side(size_t pixels)
{
    return (pixels + RELIGHT_STEP - 1) / RELIGHT_STEP;
}

/* gain (relight_side(H),relight_side(W)) of the frame that splat_draw drew last;
 * light (3): l in this frame, head frame.  Each place has the mean of the
 * foremost Gaussians whose centres lie in it, blurred over its neighbours; 1
 * where there are none.  With opt.place only. */
void splat_relight(float *gain, struct splat *s, const float light[3]);

/* color (height,width,channels: the first three, premultiplied) times the
 * gain (relight_side(from) a side) of a picture of `from` pixels a side that it
 * may have been enlarged from; at most alpha (height,width; NULL: 1). */
void relight_apply(float *color, size_t channels, const float *alpha,
                 const float *gain, size_t from, size_t height, size_t width);

#endif
