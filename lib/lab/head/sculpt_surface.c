/* The base surface of the sculpted head: a smooth blend of a few dozen
 * authored ellipsoids and tapered rods placed like the skull, its muscles and
 * fat pads.  Millimetres; the tables give the left half and the midline. */
#include "lib/lab/head/sculpt_impl.h"

enum op { ELL, ROD, CUT };   /* ellipsoid, tapered rod, ellipsoid removed */

struct form {
    const char *name;
    enum op op;
    double blend;            /* width of the smooth transition, mm */
    double a[3];             /* centre, or the rod's first end */
    double b[3];             /* radii, or the rod's second end */
    double r0, r1;           /* the rod's radii */
};

static const struct form forms[] = {
    /* skull */
    { "cranium", ELL, 0, { 0, 48, -14 }, { 74.5, 92, 91 }, 0, 0 },
    { "forehead", ELL, 22, { 0, 58, 24 }, { 60, 52, 63 }, 0, 0 },
    { "occiput", ELL, 25, { 0, 25, -48 }, { 58, 58, 54 }, 0, 0 },
    { "temple", ELL, 20, { 40, 45, 25 }, { 29, 45, 40 }, 0, 0 },
    /* face */
    { "face core", ELL, 18, { 0, -8, 30 }, { 56, 72, 52 }, 0, 0 },
    { "zygoma", ELL, 14, { 45, 4, 47 }, { 18, 12, 22 }, 0, 0 },
    { "arch", ROD, 14, { 56, 4, 40 }, { 62, 8, 2 }, 8, 8 },
    { "muzzle", ELL, 16, { 0, -42, 54 }, { 33, 30, 38 }, 0, 0 },
    { "cheek pad", ELL, 18, { 31, -20, 52 }, { 24, 26, 26 }, 0, 0 },
    { "jaw body", ROD, 15, { 14, -76, 72 }, { 44, -56, 18 }, 13, 14 },
    { "jaw ramus", ROD, 15, { 44, -54, 14 }, { 54, 5, 0 }, 15, 14 },
    { "chin", ELL, 12, { 0, -77, 72 }, { 19, 14, 19 }, 0, 0 },
    { "under chin", ELL, 18, { 0, -72, 36 }, { 38, 25, 46 }, 0, 0 },
    { "brow", ROD, 12, { 8, 40, 77 }, { 44, 41, 60 }, 9, 8 },
    /* neck */
    { "neck", ROD, 18, { 0, -60, -22 }, { 0, -210, -30 }, 50, 58 },
    { "sternomastoid", ROD, 16, { 52, -35, -24 }, { 16, -180, 26 }, 11, 10 },
    { "nape", ROD, 22, { 20, -10, -68 }, { 34, -190, -66 }, 20, 26 },
    { "larynx", ELL, 14, { 0, -120, 24 }, { 10, 14, 12 }, 0, 0 },
    /* eye sockets, then the lids over the balls */
    { "socket", CUT, 14, { 32, 24, 90 }, { 20, 11.5, 17 }, 0, 0 },
    { "inner socket", CUT, 9, { 15, 25, 88 }, { 7, 8, 9 }, 0, 0 },
    { "lids", ELL, 5, { 31.5, 25, 68 }, { 14.4, 14.4, 14.4 }, 0, 0 },
    /* nose */
    { "bridge", ROD, 8, { 0, 32, 79 }, { 0, -8, 98 }, 6.5, 8.5 },
    { "nose body", ROD, 9, { 0, 16, 75 }, { 0, -12, 88 }, 11, 15 },
    { "tip", ELL, 5, { 0, -11, 101.5 }, { 10, 9, 9.5 }, 0, 0 },
    { "wing", ELL, 4, { 12.3, -14, 92.5 }, { 5.6, 7.2, 9.5 }, 0, 0 },
    { "columella", ROD, 4, { 0, -17, 102 }, { 0, -21, 92 }, 3.8, 4.4 },
};

/* About how far p is outside an ellipsoid: exact on it and far away. */
static double surface_ellipsoid(struct vec p, const double *c, const double *r)
{
    struct vec d = sub(p, vec(c[0], c[1], c[2]));
    struct vec q = vec(d.x / r[0], d.y / r[1], d.z / r[2]);
    struct vec g = vec(q.x / r[0], q.y / r[1], q.z / r[2]);
    double k = norm(q), l = norm(g);

    return l > 1e-9 ? k * (k - 1) / l : -fmin(r[0], fmin(r[1], r[2]));
}

/* How far p is outside a rod whose radius changes along it. */
static double surface_rod(struct vec p, const struct form *f)
{
    struct vec a = vec(f->a[0], f->a[1], f->a[2]);
    struct vec ab = sub(vec(f->b[0], f->b[1], f->b[2]), a), ap = sub(p, a);
    double t = clamp01(dot(ap, ab) / dot(ab, ab));

    return norm(sub(ap, mul(ab, t))) - mix(f->r0, f->r1, t);
}

/* Polynomial smooth minimum with transition width k. */
static double surface_smooth_min(double a, double b, double k)
{
    if (k <= 0)
        return fmin(a, b);
    double h = fmax(k - fabs(a - b), 0) / k;
    return fmin(a, b) - h * h * h * k / 6;
}

static double surface_form_distance(const struct form *f, struct vec p)
{
    return f->op == ROD ? surface_rod(p, f) : surface_ellipsoid(p, f->a, f->b);
}

double sculpt_surface(struct vec p)
{
    double d = 1e9;

    for (size_t i = 0; i < sizeof forms / sizeof *forms; i++) {
        const struct form *f = &forms[i];
        int sides = f->a[0] != 0 || (f->op == ROD && f->b[0] != 0) ? 2 : 1;
        for (int s = 0; s < sides; s++) {
            struct vec q = vec(s ? -p.x : p.x, p.y, p.z);
            double e = surface_form_distance(f, q);
            d = f->op == CUT ? -surface_smooth_min(-d, e, f->blend)
                             : surface_smooth_min(d, e, f->blend);
        }
    }
    return d;
}

struct vec sculpt_surface_normal(struct vec p)
{
    const double e = 0.05;
    struct vec g = vec(
        sculpt_surface(vec(p.x + e, p.y, p.z)) -
        sculpt_surface(vec(p.x - e, p.y, p.z)),
        sculpt_surface(vec(p.x, p.y + e, p.z)) -
        sculpt_surface(vec(p.x, p.y - e, p.z)),
        sculpt_surface(vec(p.x, p.y, p.z + e)) -
        sculpt_surface(vec(p.x, p.y, p.z - e)));

    return mul(g, 1 / (2 * e));
}

struct vec sculpt_surface_project(struct vec p)
{
    for (int i = 0; i < 12; i++) {
        double d = sculpt_surface(p);
        if (fabs(d) < 1e-3)
            break;
        struct vec g = sculpt_surface_normal(p);
        double s = d / fmax(dot(g, g), 0.25);
        p = sub(p, mul(g, s > 8 ? 8 : s < -8 ? -8 : s));
    }
    return p;
}

struct vec sculpt_surface_ray(struct vec from, struct vec dir)
{
    double t = 0;

    for (int i = 0; i < 200 && t < 400; i++) {
        double d = sculpt_surface(add(from, mul(dir, t)));
        if (d < 1e-3)
            break;
        t += 0.7 * d;
    }
    return add(from, mul(dir, t));
}

/* Dents (negative) and swellings, radius r along x, y, z. */
static const struct { const char *name; double c[3], r[3], mm; } details[] = {
    { "philtrum", { 0, -29, 95 }, { 3.2, 6, 9 }, -1.1 },
    { "philtral ridge", { 5.2, -30, 95 }, { 2.6, 6, 9 }, 0.5 },
    { "chin groove", { 0, -63, 87 }, { 16, 5, 14 }, -1.8 },
    { "nasolabial fold", { 27, -24, 78 }, { 5, 11, 14 }, -1.3 },
    { "marionette", { 30, -55, 72 }, { 5, 9, 12 }, -1.0 },
    { "tear trough", { 23, 11, 78 }, { 9, 4, 10 }, -0.8 },
    { "wing groove", { 18.5, -11, 84 }, { 3, 6, 7 }, -1.2 },
    { "temple hollow", { 62, 38, 44 }, { 16, 18, 18 }, -2.0 },
    { "suborbital", { 40, -14, 64 }, { 12, 12, 14 }, -1.0 },
    { "sternal notch", { 0, -160, 30 }, { 10, 14, 14 }, -2.5 },
};

double sculpt_surface_detail(struct vec p)
{
    double sum = 0;

    for (size_t i = 0; i < sizeof details / sizeof *details; i++)
        for (int s = 0; s < (details[i].c[0] != 0 ? 2 : 1); s++) {
            double x = (s ? -p.x : p.x) - details[i].c[0];
            double y = p.y - details[i].c[1], z = p.z - details[i].c[2];
            const double *r = details[i].r;
            sum += details[i].mm * exp(-(x * x / (r[0] * r[0]) +
                   y * y / (r[1] * r[1]) + z * z / (r[2] * r[2])));
        }
    return sum;
}

/* ---- where the grid starts ---------------------------------------------- */

/* Front midline, per row: y, z, and z of the cheeks' own curve without the
 * nose; side at the ear: x, y, z; back midline: y, z. */
static const struct { double fy, fz, cz, sx, sy, sz, by, bz; }
stations[ROWS + 1] = {
    { -165, 30, 30, 57, -165, -26, -165, -88 },     /* neck cut */
    { -150, 32, 32, 56, -148, -25, -152, -86 },
    { -136, 33, 33, 55, -132, -24, -139, -84 },
    { -122, 35, 35, 54, -118, -22, -127, -82 },
    { -109, 37, 37, 54, -106, -20, -116, -80 },     /* above the larynx */
    { -101, 48, 48, 55, -96, -18, -106, -79 },
    { -98, 62, 62, 56, -87, -16, -97, -79 },
    { -95, 74, 74, 57, -79, -14, -89, -80 },
    { -91, 84, 80, 58, -72, -13, -82, -81 },        /* menton */
    { -85, 89, 82, 59, -66, -12, -75, -82 },
    { -78, 91, 84, 60, -60, -12, -68, -84 },        /* pogonion */
    { -72, 89, 85, 61, -54, -12, -61, -86 },
    { -66, 87, 86, 62, -49, -12, -54, -88 },        /* mouth block */
    { -61.2, 88, 86, 62, -45, -12, -48, -90 },
    { -56.5, 90, 87, 63, -41, -12, -42, -92 },
    { -51.8, 92, 88, 63, -37, -12, -36, -94 },
    { -47, 93, 88, 64, -33, -12, -30, -96 },        /* stomion */
    { -42.2, 93, 88, 65, -30, -12, -24, -98 },
    { -37.5, 93, 88, 65, -27, -12, -18, -99 },
    { -32.8, 93, 88, 66, -24, -12, -12, -100 },
    { -28, 94, 88, 67, -21, -12, -6, -101 },        /* ear block */
    { -23, 94.5, 87, 68, -16, -13, 0, -102 },       /* subnasale */
    { -21.5, 100, 86, 69, -11, -13, 6, -103 },
    { -19, 106, 85, 70, -6, -14, 12, -104 },
    { -14.5, 110, 84, 70, -1, -14, 17, -105 },
    { -9, 111, 83, 71, 3.8, -15, 22, -105 },        /* tip */
    { -3, 108, 82, 71, 8.5, -15, 27, -105 },
    { 2.5, 104, 81, 71.5, 13, -16, 32, -105 },
    { 8, 100, 80, 72, 18, -16, 37, -105 },          /* eye block */
    { 12.2, 97, 79, 72, 22.5, -17, 41, -105 },
    { 16.5, 94, 79, 72.5, 27, -17, 45, -105 },
    { 20.8, 90, 79, 73, 31.5, -18, 49, -105 },
    { 25, 87, 80, 73, 36, -18, 53, -104 },
    { 29.2, 86, 81, 73, 41, -19, 57, -104 },        /* sellion */
    { 33.5, 87, 83, 73, 46, -19, 61, -103 },
    { 37.8, 89, 86, 73, 51, -20, 65, -102 },
    { 42, 90, 88, 73, 56, -20, 69, -101 },          /* glabella */
    { 49, 89.5, 89, 73, 62, -20, 73, -100 },
    { 57, 89, 89, 72, 68, -20, 77, -98 },
    { 66, 88, 88, 71, 75, -20, 82, -96 },
    { 76, 86, 86, 70, 82, -20, 87, -93 },
    { 86, 82, 82, 68, 89, -20, 92, -90 },
    { 96, 77, 77, 66, 96, -20, 97, -86 },
    { 105, 70, 70, 63, 103, -20, 102, -82 },        /* crown */
};

/* Lateral distance of the front columns over the half breadth there. */
static double surface_grid_azimuth(int c)
{
    static const double x[16] = { 0, 3.5, 7, 10.5, 14, 17.5, 21, 24.5, 28,
        32, 37, 42.5, 48.5, 55, 62.5, 69 };

    if (c <= 14)
        return asin(x[c] / 72);
    if (c <= EAR_C1)
        return (80 + (c - 15) * 5.2) * M_PI / 180;
    return (106 + (c - EAR_C1) * 74.0 / (COLS - EAR_C1)) * M_PI / 180;
}

/* Where the grid starts: an outline at each height, flatter to the front. */
static struct vec surface_grid_point(int r, int c)
{
    double a = surface_grid_azimuth(c), s = sin(a), k = cos(a);
    double x = stations[r].sx * s;
    double nose = 1 - ramp(0.16, 0.34, s);

    if (k >= 0) {
        double fz = mix(stations[r].cz, stations[r].fz, nose);
        double t = ramp(0.35, 1, s);
        return vec(x, mix(stations[r].fy, stations[r].sy, t),
                   stations[r].sz + (fz - stations[r].sz) * k);
    }
    return vec(x, mix(stations[r].by, stations[r].sy, ramp(0, 1, s)),
               stations[r].sz + (stations[r].sz - stations[r].bz) * k);
}

void sculpt_grid_guess(struct half *h)
{
    for (int r = 0; r <= ROWS; r++)
        for (int c = 0; c <= COLS; c++) {
            int v = h->grid[r][c];
            if (v < 0)
                continue;
            struct vec p = sculpt_surface_project(surface_grid_point(r, c));
            if (c == 0 || c == COLS)
                p.x = 0;
            if (r == 0)
                p.y = stations[0].fy;
            h->p[v] = p;
        }
    /* crown: spread over the top from its border, then onto the surface */
    for (int i = 0; i < CAP; i++)
        for (int j = 1; j < 2 * CAP; j++) {
            struct vec side = h->p[h->cap[CAP][j]];
            double t = (double)i / CAP;
            double y = 140 - 0.4 * fabs(j - 7.0);
            struct vec mid = vec(0, y, side.z * 1.0);
            struct vec end = h->p[h->cap[0][j < CAP ? 0 : 2 * CAP]];
            double e = fabs(j - (double)CAP) / CAP;
            mid = lerp(mid, end, e * e * e);
            struct vec p = lerp(mid, side, t);
            p.y += 20 * t * (1 - t);
            p = sculpt_surface_project(p);
            if (i == 0)
                p.x = 0;
            h->p[h->cap[i][j]] = p;
        }
}
