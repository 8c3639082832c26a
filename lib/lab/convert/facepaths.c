/* Shortest ways along edges between landmarks, and the lids' closing along
 * them. */
#include "lib/lab/convert/facepaths.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/rotation.h"

#define FAR 20000       /* vertices that a search may pass */
#define REACH 0.45      /* of an eye's width: skin that a lid takes along */

static const float *facepath_vertex(const struct face_paths *p, int32_t v)
{
    return p->mesh.verts + 3 * (size_t)v;
}

int face_paths_init(struct face_paths *p, const struct face_mesh *m,
                    struct arena *memory, struct error *err)
{
    *p = (struct face_paths){
        .mesh = *m, .memory = memory,
        .cost = arena_take(memory, m->V, sizeof *p->cost),
        .from = arena_take(memory, m->V, sizeof *p->from),
        .done = arena_take(memory, m->V, sizeof *p->done),
        .open = arena_take(memory, m->V, sizeof *p->open),
        .face = arena_take(memory, m->V, sizeof *p->face)
    };
    return surface_init(&p->near, m->f, m->F, m->V, memory, err);
}

/* The vertex that a landmark is nearest to in its triangle. */
static int32_t facepath_landmark_vertex(const struct face_paths *p,
                                        int landmark)
{
    const float *b = p->mesh.landmark_bary + 3 * landmark;
    int k = b[1] > b[0] ? 1 : 0;

    if (b[2] > b[k])
        k = 2;
    return p->mesh.f[3 * (size_t)p->mesh.landmark_faces[landmark] + k];
}

/* ---- shortest paths ----------------------------------------------------- */

/* Take the nearest vertex out of the n open ones. */
static int32_t facepath_take_nearest(struct face_paths *p, size_t n)
{
    size_t best = 0;
    int32_t v;

    for (size_t i = 1; i < n; i++)
        if (p->cost[p->open[i]] < p->cost[p->open[best]])
            best = i;
    v = p->open[best];
    p->open[best] = p->open[n - 1];
    return v;
}

/* Dijkstra's search; p->from leads back.  False: not connected, or too far. */
static bool facepath_search(struct face_paths *p, int32_t start,
                            int32_t goal)
{
    size_t open = 1, passed = 0;

    for (size_t v = 0; v < p->mesh.V; v++) {
        p->cost[v] = -1;
        p->done[v] = false;
    }
    p->open[0] = start;
    p->cost[start] = 0;
    while (open && passed++ < FAR) {
        int32_t v = facepath_take_nearest(p, open--);

        if (v == goal)
            return true;
        p->done[v] = true;
        for (int32_t i = p->near.at[v]; i < p->near.at[v + 1]; i++) {
            int32_t w = p->near.link[i];
            double cost = p->cost[v] +
                          distance3(facepath_vertex(p, v),
                                            facepath_vertex(p, w));

            if (p->done[w] || (p->cost[w] >= 0 && p->cost[w] <= cost))
                continue;
            if (p->cost[w] < 0)
                p->open[open++] = w;
            p->cost[w] = cost;
            p->from[w] = v;
        }
    }
    return false;
}

int face_paths_trace(int32_t **out, size_t *count, struct face_paths *p,
                     const int *landmarks, size_t n, struct error *err)
{
    /* a way passes a vertex once at most */
    int32_t *list = arena_take(p->memory, n * p->mesh.V, sizeof *list);
    int32_t at = facepath_landmark_vertex(p, landmarks[0]);

    if (arena_check(p->memory, "a path", err))
        return -1;
    *out = list;
    *count = 1;
    list[0] = at;
    for (size_t i = 1; i < n; i++) {
        int32_t to = facepath_landmark_vertex(p, landmarks[i]);
        size_t steps = 0;

        if (!facepath_search(p, at, to))
            return error_set(err, EX_DATAERR, "vertices %d and %d of the "
                             "landmarks are not connected", at, to);
        for (int32_t v = to; v != at; v = p->from[v])
            steps++;
        *count += steps;
        for (int32_t v = to, *end = list + *count; v != at; v = p->from[v])
            *--end = v;
        at = to;
    }
    if (landmarks[0] == landmarks[n - 1] && *count > 1)
        --*count;               /* a ring: the start is not said again */
    return 0;
}

/* ---- eyelids ------------------------------------------------------------ */

/* An eye: its corners' axis, and the edges of its lids from the same corner
 * to the other. */
struct eye {
    const float *corner;
    double axis[3], width;
    int32_t *upper, *lower;
    size_t nupper, nlower;
};

/* Where along the axis a point lies: 0 at the first corner, 1 at the other. */
static double facepath_along(const struct eye *e, const float *x)
{
    double sum = 0;

    for (int c = 0; c < 3; c++)
        sum += e->axis[c] * (x[c] - e->corner[c]);
    return sum / (e->width * e->width);
}

/* The lower edge at the place t along the axis. */
static void facepath_lower_at(double out[3], const struct face_paths *p,
                              const struct eye *e, double t)
{
    size_t i = 1;

    while (i + 1 < e->nlower &&
           facepath_along(e, facepath_vertex(p, e->lower[i])) < t)
        i++;
    const float *a = facepath_vertex(p, e->lower[i - 1]);
    const float *b = facepath_vertex(p, e->lower[i]);
    double ta = facepath_along(e, a), tb = facepath_along(e, b);
    double s = tb > ta ? fmin(fmax((t - ta) / (tb - ta), 0), 1) : 0;

    for (int c = 0; c < 3; c++)
        out[c] = a[c] + s * (b[c] - a[c]);
}

/* The nearest vertex of a path, and how far it is. */
static int32_t facepath_nearest_of(double *far, const struct face_paths *p,
                                   const int32_t *path, size_t n,
                                   const float *x)
{
    int32_t best = path[0];

    *far = INFINITY;
    for (size_t i = 0; i < n; i++) {
        double d = distance3(facepath_vertex(p, path[i]), x);

        if (d < *far) {
            *far = d;
            best = path[i];
        }
    }
    return best;
}

static double facepath_radius(const double x[3], const float centre[3])
{
    double a = x[0] - centre[0], b = x[1] - centre[1], c = x[2] - centre[2];

    return sqrt(a * a + b * b + c * c);
}

/* Displacement of vertex x when the upper edge comes down. */
static void facepath_close_vertex(float out[3], const struct face_paths *p,
                                  const struct eye *e, const float *x,
                                  const float centre[3])
{
    double upper, lower, to[3], moved[3], rest[3] = {x[0], x[1], x[2]};
    const int32_t nearest = facepath_nearest_of(&upper, p, e->upper,
                                                e->nupper, x);
    const float *edge = facepath_vertex(p, nearest);

    facepath_nearest_of(&lower, p, e->lower, e->nlower, x);
    if (upper >= REACH * e->width || lower < upper)
        return;
    double s = upper / (REACH * e->width), w = (1 - s * s) * (1 - s * s);

    facepath_lower_at(to, p, e, facepath_along(e, edge));
    for (int c = 0; c < 3; c++)
        moved[c] = x[c] + w * (to[c] - edge[c]);
    double min = fmin(facepath_radius(rest, centre),
                      facepath_radius(to, centre));
    double r = facepath_radius(moved, centre);
    double grow = r > 0 && r < min ? min / r : 1;

    for (int c = 0; c < 3; c++)
        out[c] = (float)(centre[c] + grow * (moved[c] - centre[c]) - x[c]);
}

/* Mark what is connected to vertex v: the skin, not the eyeballs. */
static void facepath_mark_connected(struct face_paths *p, int32_t v)
{
    size_t n = 1;

    memset(p->face, 0, p->mesh.V * sizeof *p->face);
    p->face[v] = true;
    p->open[0] = v;
    while (n) {
        int32_t a = p->open[--n];

        for (int32_t i = p->near.at[a]; i < p->near.at[a + 1]; i++)
            if (!p->face[p->near.link[i]]) {
                p->face[p->near.link[i]] = true;
                p->open[n++] = p->near.link[i];
            }
    }
}

int face_paths_eyelid(float *out, struct face_paths *p, int side,
                      struct error *err)
{
    static const int upper[2][4] = {{42, 43, 44, 45}, {39, 38, 37, 36}};
    static const int lower[2][4] = {{42, 47, 46, 45}, {39, 40, 41, 36}};
    struct eye e;

    memset(out, 0, 3 * p->mesh.V * sizeof *out);
    if (face_paths_trace(&e.upper, &e.nupper, p, upper[side], 4, err) ||
        face_paths_trace(&e.lower, &e.nlower, p, lower[side], 4, err))
        return -1;
    e.corner = facepath_vertex(p, e.upper[0]);
    const float *other = facepath_vertex(p, e.upper[e.nupper - 1]);

    e.width = distance3(e.corner, other);
    for (int c = 0; c < 3; c++)
        e.axis[c] = other[c] - e.corner[c];
    if (!(e.width > 0) || e.nlower < 2)
        return error_set(err, EX_DATAERR, "the corners of an eye are one "
                         "vertex");
    facepath_mark_connected(p, e.upper[0]);
    for (size_t v = 0; v < p->mesh.V; v++)
        if (p->face[v])
            facepath_close_vertex(out + 3 * v, p, &e,
                                  facepath_vertex(p, (int32_t)v),
                                  p->mesh.eye[side]);
    return 0;
}
