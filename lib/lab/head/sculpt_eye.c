/* Eyelids and eyeball of the left eye.  The fissure's edge is an authored
 * almond in front view; the lids lie on a sphere a little larger than the
 * ball, and close along it. */
#include "lib/lab/head/sculpt_impl.h"

enum { HALF = EYE_N / 2 };

/* Corners of the fissure and the height of its edges over the line between
 * them, mm. */
static const double canthus_in[2] = { 16.3, 23.6 }, canthus_out[2] = { 46.6,
    26.4 };
#define UPPER_RISE 5.6
#define LOWER_DROP 5.2
#define UPPER_SHARE 0.85      /* of the way that the upper lid goes */
#define INNER_RADIUS 12.8     /* inner edge of the lid margin, open */

/* Edge of the fissure at t from the inner to the outer corner. */
static void sculpt_eye_edge(double t, bool upper, double *x, double *y)
{
    *x = mix(canthus_in[0], canthus_out[0], t);
    double line = mix(canthus_in[1], canthus_out[1], t);
    double w = upper ? pow(t, 0.80) : pow(t, 1.12);
    double arch = pow(4 * w * (1 - w), upper ? 0.80 : 0.85);
    *y = line + (upper ? UPPER_RISE : -LOWER_DROP) * arch;
}

/* Along the ring: upper from the inner corner to the outer, then back. */
static double sculpt_eye_ring_t(int i, bool *upper)
{
    *upper = i <= HALF;
    double s = i <= HALF ? (double)i / HALF : (double)(EYE_N - i) / HALF;
    return 0.5 * s + 0.5 * (0.5 - 0.5 * cos(M_PI * s));
}

/* Outward normal of the edge in front view. */
static void sculpt_eye_edge_normal(double t, bool upper, double *nx, double *ny)
{
    double x0, y0, x1, y1, e = 0.02;

    sculpt_eye_edge(clamp01(t - e), upper, &x0, &y0);
    sculpt_eye_edge(clamp01(t + e), upper, &x1, &y1);
    double dx = x1 - x0, dy = y1 - y0, l = hypot(dx, dy);
    *nx = (upper ? -dy : dy) / l;
    *ny = (upper ? dx : -dx) / l;
    /* fan out around the corners */
    double c = ramp(0.16, 0, t), o = ramp(0.84, 1, t);
    *nx = *nx * (1 - c) * (1 - o) - c + o;
    *ny = *ny * (1 - c) * (1 - o);
    l = hypot(*nx, *ny);
    *nx /= l, *ny /= l;
}

/* Distance from the edge of rings 3 to 6, at the middle of each lid and at
 * the corners, and the dent of the crease. */
static const struct { double up, low, corner, dent; } lid[EYE_MARGIN] = {
    [3] = { 9.0, 8.2, 6.5, 0.3 }, [4] = { 5.4, 5.6, 4.6, -0.9 },
    [5] = { 3.9, 3.4, 3.0, -0.3 }, [6] = { 1.6, 1.5, 1.4, 0.15 },
};

static struct vec sculpt_eye_front(double x, double y)
{
    return sculpt_surface_ray(vec(x, y, 130), vec(0, 0, -1));
}

/* Loops about the opening that sculpt_eye_edge draws, and two tucked in behind
 * its margin. */
static void sculpt_eye_place_lids(struct half *h)
{
    const struct vec e = EYE_CENTRE;

    for (int i = 0; i < EYE_N; i++) {
        bool upper;
        double t = sculpt_eye_ring_t(i, &upper), x, y, nx, ny;
        sculpt_eye_edge(t, upper, &x, &y);
        sculpt_eye_edge_normal(t, upper, &nx, &ny);
        double mid = sin(M_PI * t);
        for (int k = 3; k <= EYE_MARGIN; k++) {
            double d = k == EYE_MARGIN ? 0
                     : mix(lid[k].corner, upper ? lid[k].up : lid[k].low, mid);
            struct vec q = sculpt_eye_front(x + nx * d, y + ny * d);
            if (k < EYE_MARGIN)
                q.z += lid[k].dent * (upper ? 1 : 0.35) * mid;
            int v = h->eye[k][i];
            h->p[v] = q;
            h->hold[v] = k == 3 ? 0.5 : 1;
        }
        struct vec rim = h->p[h->eye[EYE_MARGIN][i]];
        struct vec d = sub(rim, e);
        double over = 0.6 * fmax(0, norm(d) - 14.4);
        struct vec in = unit(vec(d.x - 0.2 * nx, d.y - 0.2 * ny, d.z));
        struct vec tuck = unit(vec(d.x + 2.6 * nx, d.y + 2.6 * ny, d.z - 0.5));
        h->p[h->eye[EYE_INNER][i]] = add(e, mul(in, INNER_RADIUS + over));
        h->p[h->eye[EYE_RINGS][i]] = add(e, mul(tuck, 12.4 + over));
        h->hold[h->eye[EYE_INNER][i]] = h->hold[h->eye[EYE_RINGS][i]] = 1;
    }
    /* rings 1 and 2 start between border and crease */
    for (int k = 1; k < 3; k++)
        for (int i = 0; i < EYE_N; i++)
            h->p[h->eye[k][i]] = sculpt_surface_project(
                lerp(h->p[h->eye[0][i]], h->p[h->eye[3][i]], k / 3.0));
}

/* Polar angles of the ball's rings: pupil 2 mm, iris 5.9 mm on rings. */
static const double polar[BALL_RINGS] = { 9.6, 19.5, 29.4, 40, 54, 70, 90,
    115, 145 };

/* A sphere about its own centre; closer rings about the cornea. */
static void sculpt_eye_place_ball(struct half *h)
{
    const struct vec e = EYE_CENTRE;
    int v = h->ball_first;

    h->p[v] = add(e, vec(0, 0, EYE_RADIUS));
    for (int k = 0; k < BALL_RINGS; k++)
        for (int i = 0; i < BALL_N; i++) {
            double a = polar[k] * M_PI / 180, b = 2 * M_PI * i / BALL_N;
            h->p[v + 1 + k * BALL_N + i] = add(e, mul(vec(sin(a) * cos(b),
                sin(a) * sin(b), cos(a)), EYE_RADIUS));
        }
    int back = v + 1 + BALL_RINGS * BALL_N;
    h->p[back] = add(e, vec(0, 0, -EYE_RADIUS));
    for (int i = v; i <= back; i++)
        h->hold[i] = 1;
}

void sculpt_eye(struct half *h)
{
    sculpt_eye_place_lids(h);
    sculpt_eye_place_ball(h);
}

/* How far each ring follows the margin. */
static const double follow[EYE_RINGS + 1] = { 0, 0, 0.06, 0.2, 0.45, 0.62,
    0.86, 1, 1, 1 };

void sculpt_eyelid(const struct half *h, struct vec *delta)
{
    const struct vec e = EYE_CENTRE;

    for (int i = 0; i < EYE_N; i++) {
        bool upper;
        double t = sculpt_eye_ring_t(i, &upper), x, yu, yl;
        sculpt_eye_edge(t, 1, &x, &yu);
        sculpt_eye_edge(t, 0, &x, &yl);
        double meet = mix(yu, yl, UPPER_SHARE);
        double way = upper ? meet - yu : meet - yl;
        for (int k = 2; k <= EYE_RINGS; k++) {
            int v = h->eye[k][i];
            struct vec d = sub(h->p[v], e);
            double r = norm(d), y = d.y + way * follow[k];
            /* the two edges meet without passing through each other */
            if (k >= EYE_MARGIN)
                y += (upper ? 0.05 : -0.05) * sin(M_PI * t);
            if (k == EYE_INNER)
                r += 0.15 * sin(M_PI * t);
            if (k == EYE_RINGS)
                r += 0.35 * sin(M_PI * t);
            double zz = r * r - d.x * d.x - y * y;
            double z = d.z > 0 && zz > 0 ? sqrt(zz) : d.z;
            delta[v] = vec(0, y - d.y, z - d.z);
        }
    }
}
