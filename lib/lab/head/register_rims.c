/* What of our template is known to be what of the scans' face: lid margins,
 * lips, landmarks and ears. */
#include "lib/lab/head/register.h"

#include <string.h>
#include <sysexits.h>

#include "lib/base/rotation.h"
#include "lib/lab/head/nearest.h"
#include "lib/lab/head/scan_lids.h"

enum { LOOP = 80, EYE_LOOP = 42, MOUTH_LOOP = 74, LIP_LOOPS = 16 };

/* Share of its length at which each vertex of a path lies, 0 to 1. */
static void rim_path_shares(double *share, const int32_t *path, size_t n,
                            const float *verts)
{
    share[0] = 0;
    for (size_t i = 1; i < n; i++)
        share[i] = share[i - 1] + distance3(verts + 3 * path[i],
                                               verts + 3 * path[i - 1]);
    for (size_t i = 1; i < n; i++)
        share[i] /= share[n - 1];
}

/* Where along a path of n vertices `share` of its length is reached: index
 * and fraction. */
static double rim_path_place(double share, const double *shares, size_t n)
{
    size_t i = 0;

    while (i + 2 < n && shares[i + 1] < share)
        i++;
    return (double)i + clamp01((share - shares[i]) /
                               (shares[i + 1] - shares[i]));
}

/* A match on the edge of the path at that place, counted in its vertices. */
static struct match rim_on_path(const int32_t *path, size_t n, double place)
{
    size_t i = (size_t)fmin(place, (double)n - 2);
    double f = place - (double)i;

    return (struct match){ {path[i], path[i + 1]}, {1 - f, f}, 1 };
}

/* The point of the skin nearest to p, as a match. */
static struct match rim_on_skin(const struct nearest *t, const double p[3])
{
    struct nearest_hit hit;

    nearest_find(&hit, t, p, NULL, 0, 1);
    const int32_t *f = t->faces + 3 * hit.face;
    return (struct match){ {f[0], f[1], f[2]},
                           {hit.bary[0], hit.bary[1], hit.bary[2]}, 1 };
}

/* ---- lids --------------------------------------------------------------- */

/* Match loop k's vertices 0 to 18 (upper) or 18 to 36 = 0 (lower) to a path
 * from the inner corner to the outer. */
static void rim_match_lid(struct registration *r, int k, bool upper,
                          const int32_t *path, size_t n)
{
    enum { HALF = EYE_N / 2 };
    int32_t ours[HALF + 1];
    double mine[HALF + 1], theirs[LOOP];

    for (int i = 0; i <= HALF; i++)
        ours[i] = r->h->eye[EYE_MARGIN][upper ? i : (EYE_N - i) % EYE_N];
    rim_path_shares(mine, ours, HALF + 1, r->s->v_template);
    rim_path_shares(theirs, path, n, r->scan->neutral);
    for (int i = 0; i <= HALF; i++) {
        int v = r->h->eye[k][upper ? i : (EYE_N - i) % EYE_N];

        r->match[v] = rim_on_path(path, n, rim_path_place(mine[i], theirs, n));
    }
}

/* The skin's border behind the lids as two paths between the corners, which
 * are its vertices nearest to the middle and to the side.  The border runs
 * clockwise or not: `upper` tells by height. */
static int rim_border_paths(int32_t *path[2], size_t n[2],
                            const struct registration *r, struct error *err)
{
    int32_t loop[LOOP];
    const float *p = r->scan->neutral;
    size_t m = scan_border(loop, LOOP, r->scan, SCAN_EYE_BORDER);
    size_t in = 0, out = 0;

    if (m != EYE_LOOP)
        return error_set(err, EX_DATAERR, "the scans' lids end in %zu "
                         "vertices (expected %d)", m, EYE_LOOP);
    for (size_t i = 1; i < m; i++) {
        if (p[3 * loop[i]] < p[3 * loop[in]])
            in = i;
        if (p[3 * loop[i]] > p[3 * loop[out]])
            out = i;
    }
    for (int side = 0; side < 2; side++) {
        n[side] = 0;
        for (size_t i = in;; i = (i + (side ? m - 1 : 1)) % m) {
            path[side][n[side]++] = loop[i];
            if (i == out)
                break;
        }
    }
    if (p[3 * path[0][n[0] / 2] + 1] < p[3 * path[1][n[1] / 2] + 1]) {
        int32_t *swap = path[0];
        size_t count = n[0];

        path[0] = path[1], path[1] = swap;
        n[0] = n[1], n[1] = count;
    }
    return 0;
}

/* The margin by the scans' lids, the innermost loop by their border, and the
 * one between them on the skin. */
static int rim_match_eye(struct registration *r, const struct nearest *skin,
                         struct error *err)
{
    int32_t room[2][LOOP], *path[2] = {room[0], room[1]};
    size_t n[2] = {0, 0};

    if (rim_border_paths(path, n, r, err))
        return -1;
    rim_match_lid(r, EYE_MARGIN, 1, scan_lid_upper, SCAN_LID_UPPER);
    rim_match_lid(r, EYE_MARGIN, 0, scan_lid_lower, SCAN_LID_LOWER);
    rim_match_lid(r, EYE_RINGS, 1, path[0], n[0]);
    rim_match_lid(r, EYE_RINGS, 0, path[1], n[1]);
    for (int i = 0; i < EYE_N; i++) {   /* between the margin's two edges */
        double a[3], b[3], middle[3];

        match_point(a, &r->match[r->h->eye[EYE_MARGIN][i]],
                    r->scan->neutral);
        match_point(b, &r->match[r->h->eye[EYE_RINGS][i]], r->scan->neutral);
        for (int c = 0; c < 3; c++)
            middle[c] = 0.55 * a[c] + 0.45 * b[c];
        r->match[r->h->eye[EYE_INNER][i]] = rim_on_skin(skin, middle);
    }
    return 0;
}

/* ---- lips --------------------------------------------------------------- */

/* The scans' lips as a sheet of LIP_LOOPS loops, the mouth's border first, of
 * MOUTH_LOOP columns; left half from column `top` over `corner` to `bottom`. */
struct lips {
    int32_t v[LIP_LOOPS][MOUTH_LOOP];
    size_t top, corner, bottom;
};

/* The scans' lips as loops from the mouth's border on, all from the upper
 * middle. */
static int rim_read_lips(struct lips *l, const struct scan *s,
                         struct error *err)
{
    int32_t loop[LOOP];
    size_t n = scan_border(loop, LOOP, s, SCAN_MOUTH_BORDER), first = 0;
    int at = 0;

    if (n != MOUTH_LOOP)
        return error_set(err, EX_DATAERR, "the scans' mouth ends in %zu "
                         "vertices (expected %d)", n, MOUTH_LOOP);
    /* begin at the upper middle, left side first */
    for (size_t i = 0; i < n; i++)
        if (s->mirror[loop[i]] == loop[i] &&
            s->neutral[3 * loop[i] + 1] > s->neutral[3 * loop[first] + 1])
            first = i;
    for (size_t i = 0; i < n; i++)
        l->v[0][i] = loop[(first + i) % n];
    for (size_t k = 1; k < LIP_LOOPS; k++)
        if (scan_next_loop(l->v[k], l->v[k - 1], n, s))
            return error_set(err, EX_DATAERR, "the scans' lips have no loop "
                             "%zu (expected %d)", k, LIP_LOOPS);
    l->top = l->corner = l->bottom = 0;
    for (size_t i = 1; i < n; i++) {
        if (s->mirror[l->v[0][i]] == l->v[0][i])
            l->bottom = i;
        for (int k = 0; k < LIP_LOOPS; k++)
            if (l->v[k][i] == scan_landmarks[54])
                l->corner = i, at = k;
    }
    if (!at || l->bottom <= l->corner ||
        s->neutral[3 * l->v[at][l->corner]] < 0)
        return error_set(err, EX_DATAERR, "the scans' lips are not the ones "
                         "that are known (expected ICT-FaceKit's mesh)");
    return 0;
}

/* Loop of the vermilion border at column u, through the outer landmarks. */
static double rim_lip_border(const struct lips *l, double u)
{
    const double top = (double)l->top, corner = (double)l->corner;
    const double bottom = (double)l->bottom, t = u - top;

    if (u <= corner)
        return t < 4 ? 15 : t < 10 ? mix(15, 14, (t - 4) / 6)
                          : mix(14, 13, (u - top - 10) / (corner - top - 10));
    return mix(13, 12, clamp01((u - corner) / (0.5 * (bottom - corner))));
}

/* A match on the grid of lip loops, u along and depth across them. */
static struct match rim_on_lips(const struct lips *l, double u, double depth)
{
    size_t i = (size_t)fmin(u, MOUTH_LOOP - 2);
    size_t k = (size_t)fmin(depth, LIP_LOOPS - 2);
    double a = u - (double)i, b = depth - (double)k;

    return (struct match){
        { l->v[k][i], l->v[k][i + 1], l->v[k + 1][i], l->v[k + 1][i + 1] },
        { (1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b }, 1 };
}

/* Column of each of our places along the lips, by arc length of the inner
 * loop between middle and corner. */
static void rim_lip_columns(double *column, const struct registration *r,
                            const struct lips *l)
{
    enum { RING = 7 };                  /* of theirs, where lips touch */

    for (int lower = 0; lower < 2; lower++) {
        size_t from = lower ? l->corner : l->top;
        size_t to = lower ? l->bottom : l->corner;
        int first = lower ? MOUTH_CORNER : 0;
        double mine[MOUTH_N + 1], theirs[LOOP];
        int32_t ours[MOUTH_N + 1];

        for (int j = 0; j <= MOUTH_CORNER; j++)
            ours[j] = r->h->mouth[LIP_INNER][first + j];
        rim_path_shares(mine, ours, MOUTH_CORNER + 1, r->s->v_template);
        rim_path_shares(theirs, l->v[RING] + from, to - from + 1,
                        r->scan->neutral);
        for (int j = 0; j <= MOUTH_CORNER; j++)
            column[first + j] = (double)from +
                rim_path_place(mine[j], theirs, to - from + 1);
    }
}

/* Lip loops between the border and the innermost one, column by column. */
static int rim_match_lips(struct registration *r, struct error *err)
{
    /* Share of the way from the border (0) to the inner loop, which lies at
     * INNER where the depth of the inner ring is a typical subject's. */
    static const double way[] = { 0, 0.32, 0.60, 0.82, 1 };
    const double INNER = 7.25;
    double column[MOUTH_N + 1];
    struct lips l;

    if (rim_read_lips(&l, r->scan, err))
        return -1;
    rim_lip_columns(column, r, &l);
    for (int j = 0; j <= MOUTH_N; j++) {
        double border = rim_lip_border(&l, column[j]);

        for (int k = LIP_BORDER; k <= MOUTH_RINGS; k++) {
            double depth = k <= LIP_INNER
                ? mix(border, INNER, way[k - LIP_BORDER])
                : k == LIP_INNER + 1 ? 4 : 0;

            r->match[r->h->mouth[k][j]] = rim_on_lips(&l, column[j], depth);
        }
    }
    return 0;
}

int register_rims(struct registration *r, struct error *err)
{
    struct nearest skin;

    return nearest_init(&skin, r->scan->neutral, r->scan->f, r->scan->nf,
                        &r->memory, err) ||
           rim_match_eye(r, &skin, err) || rim_match_lips(r, err) ? -1 : 0;
}

/* ---- controls ----------------------------------------------------------- */

/* The scans' left ear in side view, metres y and z, at the twelve places of
 * our own outline: tragus, root of the helix, over the top,
 * down the back, lobe. */
static const double ear[12][2] = {
    { -.0057, .0010 }, { .0113, -.0056 }, { .0193, -.0074 },
    { .0246, -.0142 }, { .0207, -.0231 }, { .0139, -.0281 },
    { .0050, -.0303 }, { -.0066, -.0276 }, { -.0173, -.0214 },
    { -.0275, -.0080 }, { -.0305, .0010 }, { -.0180, .0020 }
};

/* The outermost point of the skin's left at y, z: of the vertices nearest in
 * side view the one that stands out most. */
static void rim_outermost(double p[3], const struct scan *s, double y, double z)
{
    p[0] = 0, p[1] = y, p[2] = z;
    for (int32_t v = 0; v < SCAN_SKIN; v++) {
        const float *q = s->neutral + 3 * v;

        if (hypot(q[1] - y, q[2] - z) < 0.002 && q[0] > p[0])
            p[0] = q[0];
    }
}

static void rim_control_at(struct control *c, const struct registration *r,
                           int v, const double to[3])
{
    for (int d = 0; d < 3; d++) {
        c->from[d] = r->s->v_template[3 * v + d];
        c->to[d] = to[d];
    }
}

static void rim_landmark_at(double p[3], const struct template *s, int k)
{
    const int32_t *f = s->f + 3 * s->landmark_face[k];

    for (int c = 0; c < 3; c++) {
        p[c] = 0;
        for (int i = 0; i < 3; i++)
            p[c] += s->landmark_bary[3 * k + i] *
                    s->v_template[3 * f[i] + c];
    }
}

size_t register_controls(struct control *c, size_t room,
                         const struct registration *r)
{
    size_t n = 0;

    for (int k = 0; k < 36; k++) {      /* jaw, brows, nose */
        const float *to = r->scan->neutral + 3 * scan_landmarks[k];
        double from[3];

        rim_landmark_at(from, r->s, k);
        if (from[0] < 0 || n == room)
            continue;
        for (int d = 0; d < 3; d++) {
            c[n].from[d] = from[d];
            c[n].to[d] = to[d];
        }
        n++;
    }
    for (int i = 0; i < 12 && n < room; i++) {
        double to[3];
        int v = r->h->ear[3][i * EAR_N / 12];

        rim_outermost(to, r->scan, ear[i][0], ear[i][1]);
        rim_control_at(&c[n++], r, v, to);
    }
    for (int i = 0; i < EYE_N && n < room; i += 2) {
        int v = r->h->eye[EYE_MARGIN][i];
        double to[3];

        match_point(to, &r->match[v], r->scan->neutral);
        rim_control_at(&c[n++], r, v, to);
    }
    for (int j = 0; j <= MOUTH_N && n < room; j += 2)
        for (int k = LIP_BORDER; k <= LIP_INNER && n < room;
             k += LIP_INNER - LIP_BORDER) {
            int v = r->h->mouth[k][j];
            double to[3];

            match_point(to, &r->match[v], r->scan->neutral);
            rim_control_at(&c[n++], r, v, to);
        }
    return n;
}
