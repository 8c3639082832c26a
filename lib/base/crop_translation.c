/* What the networks' translation of a crop means in its window. */
#include "lib/base/crop.h"

/* The networks see the crop as if it were a whole picture of S pixels with
 * focal length f, taken by a camera in front of them: a point X = R x of the
 * head lands at  u' = S/2 + f (X + t'_x) / (Z + t'_z)  of that picture.  In
 * the portrait window, of which the crop is the square of side w about c, the
 * same pixel is  u = c + (u' - S/2) w / S.  With s = S / w and d = c - S/2,
 *
 *     u - S/2 = d + (f / s) (X + t'_x) / (Z + t'_z).
 *
 * The window's own camera says  u - S/2 = f (X + t_x) / (Z + t_z).  Both agree
 * for the head's origin's depth (Z = 0) and every X when
 *
 *     t_z = s t'_z,     t_x = t'_x + d t_z / f,     and y alike.
 *
 * Neglected: (1) Z against t_z is scaled by s in one and not in the other, so
 * the perspective of a crop's picture is that of a head at t'_z, not t_z: a
 * change of relative depth of order Z (1/t_z - 1/t'_z), under 0.04 for a head
 * of half-depth 0.5 between t_z = 12 and t'_z = 7; (2) R is as seen along
 * the crop's axis: off the window's axis by the angle atan(d / f), at most 5
 * degrees at the window's edge (d = S/2, f = 6 S), which is what the rotation
 * of the same picture of a head is wrong by. */
void crop_translation(double t[3], const double tnet[3], struct square crop,
                      double S, double focal)
{
    t[2] = S / crop.size * tnet[2];
    t[0] = tnet[0] + (crop.x - S / 2) * t[2] / focal;
    t[1] = tnet[1] + (crop.y - S / 2) * t[2] / focal;
}

void crop_translation_inverse(double tnet[3], const double t[3],
                              struct square crop, double S, double focal)
{
    tnet[0] = t[0] - (crop.x - S / 2) * t[2] / focal;
    tnet[1] = t[1] - (crop.y - S / 2) * t[2] / focal;
    tnet[2] = t[2] * crop.size / S;
}

void crop_translation_backward(double gtnet[3], double gcrop[3],
                               const double gt[3], const double tnet[3],
                               struct square crop, double S, double focal)
{
    const double tz = S / crop.size * tnet[2];

    /* in the forward pass this was: t_xy = t'_xy + d t_z / f */
    const double gz = gt[2] + gt[0] * (crop.x - S / 2) / focal
                      + gt[1] * (crop.y - S / 2) / focal;

    gtnet[0] += gt[0];
    gtnet[1] += gt[1];
    gtnet[2] += gz * S / crop.size;
    gcrop[0] += gt[0] * tz / focal;
    gcrop[1] += gt[1] * tz / focal;
    gcrop[2] -= gz * tz / crop.size;
}
