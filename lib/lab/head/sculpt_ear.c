/* The left ear: a disc of concentric loops over an authored outline, from the
 * skull along the back of the auricle over the helix into the concha. */
#include "lib/lab/head/sculpt_impl.h"

#include <string.h>

/* Outline around the ear's centre: forward p and up q, mm, every twelfth of
 * the way from the tragus up, back, down to the lobe and forward again;
 * flare is how far the rim stands off the skull; groove scales the relief. */
static const struct { double p, q, flare, groove; } outline[12] = {
    { 11.5, -1, 1.5, 0.35 },        /* tragus */
    { 12.5, 12, 2.5, 0.8 },         /* root of the helix */
    { 8.5, 25, 7, 1 },
    { -2, 32, 12, 1 },              /* top */
    { -13, 29, 16, 1 },
    { -20, 19, 18.5, 1 },
    { -21.5, 6, 18.5, 1 },          /* back */
    { -19, -7, 16, 1 },
    { -13.5, -18.5, 12, 0.7 },
    { -5.5, -28.5, 8, 0.15 },       /* lobe */
    { 3, -29.5, 4.5, 0.1 },
    { 9.5, -17, 2, 0.15 },
};

/* Per ring: size of the loop, height relative to the flare and absolute, and
 * how much of the relief (the part that vanishes on the lobe) it carries. */
static const struct { double size, lift, rise; } rings[EAR_RINGS + 1] = {
    { 0.80, 0, 0 },          /* on the skull */
    { 0.86, 0.45, 0 },       /* back of the auricle */
    { 0.975, 0.90, -1.2 },
    { 1.00, 1.0, 0.3 },      /* helix, outer edge */
    { 0.965, 1.0, 1.6 },     /* helix, crest */
    { 0.895, 1.0, 1.2 },
    { 0.815, 0.86, -2.4 },   /* scapha */
    { 0.70, 0.80, -0.6 },
    { 0.585, 0.72, 1.6 },    /* antihelix */
    { 0.48, 0.45, -1.0 },
    { 0.42, 0.02, -3.5 },    /* wall of the concha */
    { 0.32, 0, -5.0 },
};

/* Closed Catmull-Rom spline through twelve values, t in 0..12. */
static double ear_spline(const double *y, double t)
{
    int i = (int)floor(t);
    double u = t - i;
    double a = y[(i + 11) % 12], b = y[i % 12], c = y[(i + 1) % 12],
           d = y[(i + 2) % 12];

    return b + 0.5 * u * (c - a + u * (2 * a - 5 * b + 4 * c - d +
           u * (3 * (b - c) + d - a)));
}

/* Ear plane to the head: tilted back by 12 degrees, standing on the skull. */
static struct vec ear_point(double p, double q, double w)
{
    const struct vec centre = vec(0, 9, -20);
    const double c = cos(12 * M_PI / 180), s = sin(12 * M_PI / 180);
    double y = centre.y + q * c + p * s, z = centre.z - q * s + p * c;
    struct vec skull = sculpt_surface_ray(vec(130, y, z), vec(-1, 0, 0));

    /* the plane leans on a smoothed skull: no bumps of the jaw in the ear */
    double base = 0.45 * skull.x + 0.55 * (69.5 + 0.05 * (p + 5));
    return vec(base + w, y, z);
}

/* The ear's loops, from the skin of the skull over the rim into the concha. */
static void ear_make_rings(struct half *h)
{
    double op[12], oq[12], of[12], og[12];

    for (int i = 0; i < 12; i++) {
        op[i] = outline[i].p, oq[i] = outline[i].q;
        of[i] = outline[i].flare, og[i] = outline[i].groove;
    }
    for (int j = 0; j < EAR_N; j++) {
        double t = 12.0 * j / EAR_N;
        double p = ear_spline(op, t), q = ear_spline(oq, t);
        double flare = fmax(ear_spline(of, t), 0.8), groove = ear_spline(og, t);
        for (int k = 0; k <= EAR_RINGS; k++) {
            double size = rings[k].size, g = k < 3 ? 1 : groove;
            /* in front the loops lie flat: the skin runs into the cheek */
            double front = ramp(4, 11, p) * ramp(-34, -14, q);
            if (k < 4)
                size = mix(size, 1.10 - 0.03 * k, front);
            /* the concha lies forward of the middle and low */
            double in = 1 - size, cp = 3.5 * in * 1.4, cq = -5 * in * 1.4;
            double rise = rings[k].rise * g;
            double lift = rings[k].lift;
            if (k >= 6)   /* without relief the inside follows the rim */
                lift = mix(1 - 0.4 * in, lift, k < 9 ? groove :
                           fmax(groove, ramp(0.7, 0.4, size)));
            struct vec a = ear_point(p * size + cp, q * size + cq,
                                     flare * lift + rise);
            int v = h->ear[k][j];
            if (k == 0)
                a = sculpt_surface_project(ear_point(p * size + cp,
                                                     q * size + cq, 0));
            h->p[v] = a;
            h->hold[v] = k == 0 ? 0.9 : 1;
            h->snap[v] = k == 0;
        }
    }
}

/* The floor of the concha: a Coons patch from its border, hollowed. */
static void ear_make_floor(struct half *h)
{
    int w = EAR_C1 - EAR_C0, t = EAR_R1 - EAR_R0;
    int (*f)[EAR_C1 - EAR_C0 + 1] = h->ear_fill;

    for (int r = 1; r < t; r++)
        for (int c = 1; c < w; c++) {
            double a = (double)c / w, b = (double)r / t;
            struct vec u = lerp(h->p[f[r][0]], h->p[f[r][w]], a);
            struct vec v = lerp(h->p[f[0][c]], h->p[f[t][c]], b);
            struct vec x = lerp(lerp(h->p[f[0][0]], h->p[f[0][w]], a),
                                lerp(h->p[f[t][0]], h->p[f[t][w]], a), b);
            struct vec q = sub(add(u, v), x);
            q.x -= 1.5 * sin(M_PI * a) * sin(M_PI * b);
            h->p[f[r][c]] = q;
            h->hold[f[r][c]] = 1;
            h->snap[f[r][c]] = 0;
        }
}

void sculpt_ear(struct half *h)
{
    ear_make_rings(h);
    ear_make_floor(h);
}

/* Nostril: an oval on the underside of the nose, three loops inwards. */
void sculpt_nostril(struct half *h)
{
    static const double up[NOS_RINGS + 1] = { 0, 1.2, 4.0, 7.0 };
    static const double size[NOS_RINGS + 1] = { 1, 0.80, 0.62, 0.40 };
    const struct vec c = vec(7.0, -20.0, 97.5);
    const struct vec along = unit(vec(-0.42, 0.10, 1));      /* to the tip */
    const struct vec across = unit(vec(1, -0.10, 0.35));

    for (int k = 0; k <= NOS_RINGS; k++)
        for (int i = 0; i < NOS_N; i++) {
            /* index 0 is the midline side; then front, outside, back */
            double a = M_PI - 2 * M_PI * i / NOS_N;
            struct vec q = add(c, add(mul(across, 3.1 * size[k] * cos(a)),
                                      mul(along, 5.4 * size[k] * sin(a))));
            if (k == 0)
                q = sculpt_surface_ray(vec(q.x, -60, q.z), vec(0, 1, 0));
            else
                q = vec(q.x + 0.2 * up[k],
                        h->p[h->nostril[0][i]].y * 0.5 + 0.5 * c.y + up[k],
                        q.z - 0.35 * up[k]);
            int v = h->nostril[k][i];
            h->p[v] = q;
            h->hold[v] = k ? 1 : 0.9;
            h->snap[v] = k == 0;
        }
    int v = h->nostril_fill[1][1];
    struct vec sum = vec(0, 0, 0);
    for (int i = 0; i < NOS_N; i++)
        sum = add(sum, mul(h->p[h->nostril[NOS_RINGS][i]], 1.0 / NOS_N));
    h->p[v] = add(sum, vec(0, 1, 0));
    h->hold[v] = 1;
    h->snap[v] = 0;
}
