/* Rims, bending, iterated closest points, evening out: one after another. */
#include "lib/lab/head/register.h"

#include <string.h>

#include "lib/base/rotation.h"
#include "lib/lab/head/nearest.h"

enum { CONTROLS = 160 };

void match_point(double out[3], const struct match *m, const float *x)
{
    for (int c = 0; c < 3; c++) {
        out[c] = 0;
        for (int k = 0; k < 4; k++)
            out[c] += m->w[k] * x[3 * m->v[k] + c];
    }
}

/* ---- iterated closest points -------------------------------------------- */

struct fit {
    struct registration *r;
    struct nearest skin;
    double *start, *d, *target, *weight, *normal, *along;
};

static bool register_is_ball(const struct registration *r, size_t v)
{
    return r->s->region[v] == REGION_EYEBALL;
}

/* Vertex of the left half (or midline) that v is, or mirrors. */
static size_t register_left(const struct registration *r, size_t v)
{
    return v < (size_t)r->h->nv ? v : (size_t)r->h->mirror[v];
}

/* How far the scans are to be followed at p: down the throat to where their
 * shoulders begin, at the back higher up. */
static double register_reach(const double p[3])
{
    double front = ramp(0, 0.05, p[2]);

    return ramp(mix(-0.106, -0.118, front), mix(-0.082, -0.096, front), p[1]);
}

/* Unit normals (nv,3) of the mesh at `at`, each face by its area. */
static void register_normals(double *n, const struct template *s,
                             const double *at)
{
    memset(n, 0, 3 * s->nv * sizeof *n);
    for (size_t i = 0; i < s->nf; i++) {
        const int32_t *f = s->f + 3 * i;
        double u[3], v[3], g[3];

        for (int c = 0; c < 3; c++) {
            u[c] = at[3 * f[1] + c] - at[3 * f[0] + c];
            v[c] = at[3 * f[2] + c] - at[3 * f[0] + c];
        }
        cross3_d(g, u, v);
        for (int k = 0; k < 3; k++)
            for (int c = 0; c < 3; c++)
                n[3 * f[k] + c] += g[c];
    }
    for (size_t v = 0; v < s->nv; v++) {
        double *x = n + 3 * v;
        double l = sqrt(dot3_d(x, x)) + 1e-30;

        for (int c = 0; c < 3; c++)
            x[c] /= l;
    }
}

/* The right half is the left one's mirror image; x = 0 on the midline. */
static void register_mirror(double *x, const struct registration *r)
{
    for (size_t v = 0; v < (size_t)r->h->nv; v++) {
        size_t w = (size_t)r->h->mirror[v];

        if (w == v)
            x[3 * v] = 0;
        x[3 * w] = -x[3 * v];
        x[3 * w + 1] = x[3 * v + 1];
        x[3 * w + 2] = x[3 * v + 2];
    }
}

/* A left vertex's match to the skin near p, its normal agreeing to `min`.
 * Trusted as far as the scans reach; not at all when nothing is near. */
static void register_match_near(struct match *m, const struct fit *f,
                                const double p[3], const double *normal,
                                double min, double max)
{
    struct nearest_hit hit;

    nearest_find(&hit, &f->skin, p, normal, min, max);
    *m = (struct match){.trust = 0};
    if (hit.face < 0)
        return;
    for (int k = 0; k < 3; k++) {
        m->v[k] = f->skin.faces[3 * hit.face + k];
        m->w[k] = hit.bary[k];
    }
    m->trust = register_reach(p);
}

/* Vertices matched by their loops keep that match. */
static bool register_is_rim(const struct registration *r, size_t v)
{
    const struct loops *h = r->h;

    v = register_left(r, v);
    return (h->part[v] == PART_EYE && h->ring[v] >= EYE_MARGIN) ||
           (h->part[v] == PART_MOUTH && h->ring[v] >= LIP_BORDER);
}

/* The mirror image's match, by the scans' own symmetry. */
static void register_mirror_match(struct match *out, const struct match *m,
                                  const struct scan *s)
{
    *out = *m;
    for (int k = 0; k < 4; k++)
        out->v[k] = s->mirror[m->v[k]];
}

/* Matches of all vertices at their present places. */
static void register_match_all(struct fit *f, double min, double max)
{
    struct registration *r = f->r;

    for (size_t v = 0; v < (size_t)r->h->nv; v++) {
        if (register_is_ball(r, v))
            r->match[v].trust = 0;
        else if (!register_is_rim(r, v))
            register_match_near(&r->match[v], f, r->at + 3 * v,
                                f->normal + 3 * v, min, max);
        if ((size_t)r->h->mirror[v] != v)
            register_mirror_match(&r->match[r->h->mirror[v]], &r->match[v],
                                  r->scan);
    }
}

/* One step: the smooth displacement from the start that lies near the
 * matches. */
static int register_step(struct fit *f, double stiff, double slide,
                         struct error *err)
{
    struct registration *r = f->r;

    for (size_t v = 0; v < r->s->nv; v++) {
        const struct match *m = &r->match[v];
        double p[3];
        /* the neck's cut stays where it is */
        bool cut = r->h->part[register_left(r, v)] == PART_GRID &&
                  r->h->row[register_left(r, v)] == 0;

        match_point(p, m, r->scan->neutral);
        f->weight[v] = register_is_rim(r, v) ? 20 : m->trust;
        f->along[v] = register_is_rim(r, v) ? 1 : slide;
        for (size_t c = 0; c < 3; c++)
            f->target[3 * v + c] = m->trust > 0
                ? p[c] - f->start[3 * v + c] : 0;
        if (cut && m->trust <= 0) {
            f->weight[v] = 1;
            f->along[v] = 1;
        }
    }
    if (smooth_fit(f->d, &f->r->mesh, f->target, f->weight, f->normal, f->along,
                   stiff, 400, err))
        return -1;
    register_mirror(f->d, r);
    for (size_t i = 0; i < 3 * r->s->nv; i++)
        r->at[i] = f->start[i] + f->d[i];
    register_normals(f->normal, r->s, r->at);
    return 0;
}

static bool register_is_nostril(const struct loops *h, size_t v)
{
    bool found = false;

    for (int i = 0; i < NOS_N; i++)
        found |= h->nostril[0][i] == (int)v;
    return found;
}

/* How close together vertices should lie: closer where the skin bends more,
 * on the nose. */
static double register_density(const double p[3])
{
    double y = p[1] + 0.012, z = p[2] - 0.100;
    double square = p[0] * p[0] + y * y + z * z;

    return 1 + 4 * exp(-square / (0.024 * 0.024));
}

/* The middle of v's neighbours, each with its density. */
static void register_dense_mean(double out[3], const struct fit *f, size_t v)
{
    const struct smooth_mesh *m = &f->r->mesh;
    double sum = 0;

    memset(out, 0, 3 * sizeof *out);
    for (int32_t i = m->at[v]; i < m->at[v + 1]; i++) {
        const double *p = f->r->at + 3 * m->link[i];
        double w = register_density(p);

        sum += w;
        for (int c = 0; c < 3; c++)
            out[c] += w * p[c];
    }
    for (int c = 0; c < 3; c++)
        out[c] /= sum;
}

/* Free skin slides to the middle of its neighbours, along the surface. */
static void register_even_out(struct fit *f, double much)
{
    struct registration *r = f->r;
    const struct loops *h = r->h;

    for (size_t v = 0; v < (size_t)h->nv; v++) {
        double mean[3], p[3];
        int part = h->part[v], ring = h->ring[v];
        bool stays = register_is_rim(r, v) || register_is_ball(r, v)
                     || part == PART_EAR || part == PART_NOSTRIL
                     || register_is_nostril(h, v) || r->match[v].trust < 1
                     || (part == PART_EYE && ring > 5)
                     || (part == PART_MOUTH && ring > 3);

        if (stays)
            continue;
        register_dense_mean(mean, f, v);
        for (size_t c = 0; c < 3; c++)
            p[c] = mix(r->at[3 * v + c], mean[c], much);
        if (h->seam[v])
            p[0] = 0;
        register_match_near(&r->match[v], f, p, f->normal + 3 * v, 0.3, 0.02);
        match_point(r->at + 3 * v, &r->match[v], r->scan->neutral);
    }
    register_mirror(r->at, r);
    register_normals(f->normal, r->s, r->at);
}

/* Trusted vertices lie where they are matched. */
static void register_pin_trusted(struct fit *f)
{
    struct registration *r = f->r;

    register_match_all(f, 0.3, 0.02);
    for (size_t v = 0; v < r->s->nv; v++) {
        double p[3];

        match_point(p, &r->match[v], r->scan->neutral);
        for (size_t c = 0; r->match[v].trust >= 1 && c < 3; c++)
            r->at[3 * v + c] = p[c];
    }
    register_mirror(r->at, r);
    register_normals(f->normal, r->s, r->at);
}

/* The extent of the neck's cut: half its width, its back and its front. */
static void register_cut_extent(double e[3], const struct registration *r)
{
    e[0] = 0, e[1] = INFINITY, e[2] = -INFINITY;
    for (int c = 0; c <= COLS; c++) {
        const double *x = r->at + 3 * r->h->grid[0][c];

        e[0] = fmax(e[0], x[0]);
        e[1] = fmin(e[1], x[2]);
        e[2] = fmax(e[2], x[2]);
    }
}

/* The neck's cut without the throat's folds: evened out along
 * itself, then as wide and deep as it was. */
static void register_smooth_cut(struct registration *r)
{
    const int *row = r->h->grid[0];
    double was[3], is[3];

    register_cut_extent(was, r);
    for (int round = 0; round < 120; round++)
        for (int c = 0; c <= COLS; c++) {
            const double *a = r->at + 3 * row[c ? c - 1 : 1];
            const double *b = r->at + 3 * row[c < COLS ? c + 1 : COLS - 1];
            double *x = r->at + 3 * row[c];

            if (c > 0 && c < COLS)
                x[0] = mix(x[0], (a[0] + b[0]) / 2, 0.5);
            x[2] = mix(x[2], (a[2] + b[2]) / 2, 0.5);
        }
    register_cut_extent(is, r);
    for (int c = 0; c <= COLS; c++) {
        double *x = r->at + 3 * row[c];

        x[0] *= was[0] / is[0];
        x[2] = was[1] + (x[2] - is[1]) * (was[2] - was[1]) / (is[2] - is[1]);
    }
    register_mirror(r->at, r);
}

/* Below the scans the neck is a thin plate between them and its own cut. */
static int register_fill_neck(struct fit *f, struct error *err)
{
    struct registration *r = f->r;

    register_smooth_cut(r);
    for (size_t v = 0; v < r->s->nv; v++) {
        size_t u = register_left(r, v);
        bool cut = r->h->part[u] == PART_GRID && r->h->row[u] == 0;
        double trust = r->match[v].trust;

        f->weight[v] = register_is_ball(r, v) || trust >= 1 ? 1e4
                     : trust > 0 ? 0.3 * trust * trust : cut ? 1e3 : 0;
        for (size_t c = 0; c < 3; c++) {
            f->d[3 * v + c] = r->at[3 * v + c];
            f->target[3 * v + c] = r->at[3 * v + c];
        }
    }
    if (smooth_fit(f->d, &f->r->mesh, f->target, f->weight, NULL, NULL, 1, 2000,
                   err))
        return -1;
    for (size_t i = 0; i < 3 * r->s->nv; i++)
        if (!register_is_ball(r, i / 3) && r->match[i / 3].trust < 1)
            r->at[i] = f->d[i];
    register_mirror(r->at, r);
    register_normals(f->normal, r->s, r->at);
    return 0;
}

/* Rims proper: lid margins, and the lips from where they touch. */
static bool register_is_still(const struct registration *r, size_t v)
{
    const struct loops *h = r->h;

    v = register_left(r, v);
    return (h->part[v] == PART_EYE && h->ring[v] >= EYE_MARGIN) ||
           (h->part[v] == PART_MOUTH && h->ring[v] > 7);
}

/* For each vertex, from the scans' that lie on its faces: how far outside they
 * are along its normal, summed into f->weight, and their shares in f->along. */
static void register_swell_measure(struct fit *f, const struct nearest *ours)
{
    const struct registration *r = f->r;

    memset(f->weight, 0, r->s->nv * sizeof *f->weight);
    memset(f->along, 0, r->s->nv * sizeof *f->along);
    for (int32_t v = 0; v < SCAN_SKIN; v++) {
        const float *q = r->scan->neutral + 3 * v;
        double p[3] = {q[0], q[1], q[2]};
        struct nearest_hit hit;

        nearest_find(&hit, ours, p, NULL, 0, 0.002);
        for (int k = 0; hit.face >= 0 && k < 3; k++) {
            size_t u = (size_t)r->s->f[3 * hit.face + k];
            const double *n = f->normal + 3 * u;

            f->along[u] += hit.bary[k];
            for (int c = 0; c < 3; c++)
                f->weight[u] += hit.bary[k] * n[c] * (p[c] - hit.at[c]);
        }
    }
}

/* Move each vertex along its normal by most of what was measured, a millimetre
 * from home (f->d) at the most. */
static void register_swell_move(struct fit *f)
{
    struct registration *r = f->r;

    for (size_t v = 0; v < r->s->nv; v++) {
        const double *source_mean = f->d + 3 * v, *n = f->normal + 3 * v;
        double *x = r->at + 3 * v, up = 0;

        if (register_is_still(r, v) || register_is_ball(r, v)
            || r->match[v].trust < 1 || f->along[v] < 0.5)
            continue;
        for (int c = 0; c < 3; c++)
            up += n[c] * (x[c] - source_mean[c]);
        up = fmax(-0.001, fmin(0.001, up + 0.6 * f->weight[v] / f->along[v]));
        for (int c = 0; c < 3; c++)
            x[c] = source_mean[c] + up * n[c];
    }
    register_mirror(r->at, r);
}

/* Flat faces cut the corners of a round surface: raise the vertices until the
 * scans' own lie as much outside of our faces as inside.  At most a
 * millimetre; rims stay where they are. */
static int register_swell(struct fit *f, struct error *err)
{
    enum { ROUNDS = 8 };
    struct registration *r = f->r;
    size_t nv = r->s->nv;
    float *verts = arena_take(&r->memory, 3 * nv, sizeof *verts);
    struct nearest ours;

    if (arena_check(&r->memory, "a registration", err))
        return -1;
    for (size_t i = 0; i < 3 * nv; i++)
        verts[i] = (float)r->at[i];
    if (nearest_init(&ours, verts, r->s->f, r->s->nf, &r->memory, err))
        return -1;
    for (int round = 0; round < ROUNDS; round++) {
        register_swell_measure(f, &ours);
        register_swell_move(f);
        for (size_t i = 0; i < 3 * nv; i++)
            verts[i] = (float)r->at[i];
        nearest_update(&ours);
    }
    return 0;
}

/* Towards their corners the scans' lips lie in each other by a tenth of a
 * millimetre: there the loops where they touch are drawn a little apart. */
static void register_part_lips(struct registration *r)
{
    const double min = 0.00025;

    for (int k = LIP_INNER - 1; k <= LIP_INNER; k++)
        for (int j = 1; j < MOUTH_CORNER; j++) {
            double *up = r->at + 3 * r->h->mouth[k][j];
            double *low = r->at + 3 * r->h->mouth[k][MOUTH_N - j];
            double want = j == MOUTH_CORNER - 1 ? 0.6 * min : min;
            double push = fmax(0, want - (up[1] - low[1])) / 2;

            up[1] += push;
            low[1] -= push;
        }
    register_mirror(r->at, r);
}

/* Stiff at first, then less and less; at the end what the scans do not
 * reach. */
static int register_all(struct fit *f, struct error *err)
{
    enum { STEPS = 24 };

    for (int i = 0; i < STEPS; i++) {
        double t = (double)i / (STEPS - 1);

        register_match_all(f, 0.35, 0.02);
        if (register_step(f, 60 * pow(0.01 / 60, t), mix(0.3, 0.05, t), err))
            return -1;
    }
    register_pin_trusted(f);
    for (int i = 0; i < 30; i++)
        register_even_out(f, 0.4);
    if (register_fill_neck(f, err))
        return -1;
    memcpy(f->d, f->r->at, 3 * f->r->s->nv * sizeof *f->d);
    if (register_swell(f, err))
        return -1;
    register_part_lips(f->r);
    return 0;
}

/* Bend the template by the rims, landmarks and ears, both sides, less and
 * less down the neck. */
static int register_bend_template(struct registration *r, struct error *err)
{
    struct control c[2 * CONTROLS];
    size_t n = register_controls(c, CONTROLS, r), both = n;

    for (size_t i = 0; i < n; i++)
        if (c[i].from[0] > 1e-9) {
            c[both] = c[i];
            c[both].from[0] *= -1;
            c[both++].to[0] *= -1;
        } else {
            c[i].from[0] = c[i].to[0] = 0;
        }
    if (register_bend(r->at, r->s->nv, c, both, err))
        return -1;
    for (size_t i = 0; i < 3 * r->s->nv; i++) {
        const float *p = r->s->v_template + i / 3 * 3;

        r->at[i] = mix(p[i % 3], r->at[i], ramp(-0.16, -0.09, p[1]));
    }
    return 0;
}

/* Memory, neighbours, and the search tree over the scans. */
static int register_fit_init(struct fit *f, struct registration *r,
                             struct error *err)
{
    const size_t n = 3 * r->s->nv;
    struct arena *a = &r->memory;

    *f = (struct fit){
        .r = r,
        .start = arena_take(a, n, sizeof *f->start),
        .d = arena_take(a, n, sizeof *f->d),
        .target = arena_take(a, n, sizeof *f->target),
        .weight = arena_take(a, n, sizeof *f->weight),
        .normal = arena_take(a, n, sizeof *f->normal),
        .along = arena_take(a, n, sizeof *f->along)
    };
    if (arena_check(a, "a registration", err))
        return -1;
    memcpy(f->start, r->at, n * sizeof *f->start);
    register_normals(f->normal, r->s, r->at);
    return smooth_mesh_init(&r->mesh, r->s->f, r->s->nf, r->s->nv, a, err) ||
           nearest_init(&f->skin, r->scan->neutral, r->scan->f, r->scan->nf, a,
                        err) ? -1 : 0;
}

int registration_init(struct registration *r, const struct template *s,
                      const struct scan *scan, struct error *err)
{
    struct arena *a = &r->memory;
    struct fit f;

    *r = (struct registration){.s = s, .scan = scan};
    r->h = arena_take(a, 1, sizeof *r->h);
    r->match = arena_take(a, s->nv, sizeof *r->match);
    r->at = arena_take(a, 3 * s->nv, sizeof *r->at);
    if (arena_check(a, "a registration", err)) {
        registration_release(r);
        return -1;
    }
    loops_make(r->h);
    for (size_t i = 0; i < 3 * s->nv; i++)
        r->at[i] = s->v_template[i];
    if (register_rims(r, err) || register_bend_template(r, err) ||
        register_fit_init(&f, r, err) || register_all(&f, err)) {
        registration_release(r);
        return -1;
    }
    return 0;
}

void registration_release(struct registration *r)
{
    arena_release(&r->memory);
    *r = (struct registration){.s = NULL};
}
