/* The colours of a PLY's Gaussians from where they are seen: the higher bands
 * of their spherical harmonics. */
#include "formats/ply.h"

#include <math.h>

/* Real spherical harmonics of degrees 1 to 3 in the order and with the signs
 * of the 3DGS files. */
static void ply_sh_basis(double y[15], const double d[3])
{
    const double X = d[0], Y = d[1], Z = d[2];
    const double xx = X * X, yy = Y * Y, zz = Z * Z;
    const double c1 = sqrt(3 / (4 * M_PI)), c2 = sqrt(15 / (4 * M_PI));
    const double c20 = sqrt(5 / (16 * M_PI));
    const double c33 = sqrt(35 / (32 * M_PI)), c32 = sqrt(105 / (4 * M_PI));
    const double c31 = sqrt(21 / (32 * M_PI)), c30 = sqrt(7 / (16 * M_PI));

    y[0] = -c1 * Y;
    y[1] = c1 * Z;
    y[2] = -c1 * X;
    y[3] = c2 * X * Y;
    y[4] = -c2 * Y * Z;
    y[5] = c20 * (2 * zz - xx - yy);
    y[6] = -c2 * X * Z;
    y[7] = c2 / 2 * (xx - yy);
    y[8] = -c33 * Y * (3 * xx - yy);
    y[9] = c32 * X * Y * Z;
    y[10] = -c31 * Y * (4 * zz - xx - yy);
    y[11] = c30 * Z * (2 * zz - 3 * xx - 3 * yy);
    y[12] = -c31 * X * (4 * zz - xx - yy);
    y[13] = c32 / 2 * Z * (xx - yy);
    y[14] = -c33 * X * (xx - 3 * yy);
}

void ply_shade(struct splats *s, const float eye[3])
{
    int per = (s->degree + 1) * (s->degree + 1) - 1;
    double flip = s->rotated ? -1 : 1;

    if (!s->rest)
        return;
    for (size_t i = 0; i < s->n; i++) {
        const float *m = s->mean + 3 * i;
        double d[3] = {flip * (m[0] - eye[0]), flip * (m[1] - eye[1]),
                       m[2] - eye[2]};
        double n = fmax(sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]), 1e-12);
        double y[15];

        for (int k = 0; k < 3; k++)
            d[k] /= n;
        ply_sh_basis(y, d);
        for (int c = 0; c < 3; c++) {
            const float *r = s->rest + (3 * i + (size_t)c) * (size_t)per;
            double v = s->color[3 * i + (size_t)c];

            for (int k = 0; k < per; k++)
                v += y[k] * r[k];
            s->color[3 * i + (size_t)c] = (float)fmax(v, 0);
        }
    }
}
