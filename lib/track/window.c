/* Where a head is, and the window about it (window.h). */
#include "lib/track/window.h"

#include <math.h>

#include "lib/base/camera.h"

void window_about_head(struct square *window, struct motion *m, double S,
                       bool whole)
{
    const double focal = camera_focal((float)S);
    const double at[3] = {m->t[0], m->t[1], fmax(m->t[2], CAMERA_NEAR)};
    const struct square was = *window;
    const struct square crop = {m->crop[0], m->crop[1], m->crop[2]};
    double own[3], to[3];
    struct square q = square_out_of((struct square){
        S / 2 + focal * at[0] / at[2], S / 2 + focal * at[1] / at[2],
        S * WINDOW_DISTANCE / at[2]}, was, S);

    if (whole) {
        const double size = round(q.size), half = size / 2;

        q = (struct square){round(q.x - half) + half, round(q.y - half) + half,
                            size};
    }
    *window = q;
    const struct square now = square_into(square_out_of(crop, was, S), q, S);
    crop_translation_inverse(own, at, crop, S, focal);
    crop_translation(to, own, now, S, focal);
    for (int k = 0; k < 3; k++)
        m->t[k] = (float)to[k];
    m->crop[0] = (float)now.x;
    m->crop[1] = (float)now.y;
    m->crop[2] = (float)now.size;
}
