/* Bending one template onto the other, nearest points, and two regularised
 * least-squares fits. */
#include "lib/lab/head/map.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/arena.h"
#include "lib/base/cholesky.h"
#include "lib/base/parallel.h"
#include "lib/base/rotation.h"
#include "lib/head/lbs.h"
#include "lib/lab/head/nearest.h"

#define INNER 17            /* landmarks before it are the contour */
#define NEAR 0.05           /* 10 mm: trust falls to 1/e at this distance */
#define POINTS 300.0        /* about so many independent points a mesh has */
#define SLIP_EXP 0.0025     /* 0.5 mm: what an expression may leave over */
#define SLIP_SHAPE 0.005    /* 1 mm: what a shape may */
#define JAW 0.2f            /* radians: a usual turn, and the step of its
                             * differences */

/* ---- bending ------------------------------------------------------------ */

/* A place of the mesh and where it belongs. */
struct control { double from[3], to[3]; };

/* Solve A X = B, A (n,n), B (n,3), in place, with the largest pivot. */
static int map_solve(double *A, double *B, size_t n)
{
    for (size_t k = 0; k < n; k++) {
        size_t best = k;

        for (size_t i = k + 1; i < n; i++)
            if (fabs(A[i * n + k]) > fabs(A[best * n + k]))
                best = i;
        if (fabs(A[best * n + k]) < 1e-14)
            return -1;
        for (size_t j = 0; best != k && j < n + 3; j++) {
            double *x = j < n ? A + k * n + j : B + k * 3 + j - n;
            double *y = j < n ? A + best * n + j : B + best * 3 + j - n;
            double swap = *x;

            *x = *y;
            *y = swap;
        }
        for (size_t i = 0; i < n; i++) {
            double f = i == k ? 0 : A[i * n + k] / A[k * n + k];

            for (size_t j = k; f != 0 && j < n; j++)
                A[i * n + j] -= f * A[k * n + j];
            for (size_t j = 0; f != 0 && j < 3; j++)
                B[i * 3 + j] -= f * B[k * 3 + j];
        }
    }
    for (size_t i = 0; i < 3 * n; i++)
        B[i] /= A[i / 3 * n + i / 3];
    return 0;
}

/* at (n,3) bent through the controls by |r| plus an affine map, the smoothest
 * such bending there is: d(p) = sum_i w_i |p - from_i| + a + A p, through
 * to - from at the controls but for `slack` metres of give. */
static int map_bend_mesh(double *at, size_t n, const struct control *c,
                         size_t count, struct error *err)
{
    const double slack = 1e-4;
    size_t m = count + 4;
    struct arena room = {0};
    double *A = arena_take(&room, m * m, sizeof *A);
    double *B = arena_take(&room, 3 * m, sizeof *B);
    int rc = arena_check(&room, "controls", err);

    if (rc)
        goto out;
    for (size_t i = 0; i < count; i++) {
        for (size_t j = 0; j < count; j++)
            A[i * m + j] = distance3_d(c[i].from, c[j].from);
        A[i * m + i] -= slack;
        for (size_t k = 0; k < 4; k++)
            A[i * m + count + k] = A[(count + k) * m + i] =
                k ? c[i].from[k - 1] : 1;
        for (size_t k = 0; k < 3; k++)
            B[3 * i + k] = c[i].to[k] - c[i].from[k];
    }
    rc = !map_solve(A, B, m) ? 0 :
             error_set(err, EX_DATAERR, "the controls do not span a space "
                       "(expected four apart)");
    for (size_t v = 0; !rc && v < n; v++) {
        double p[3], *x = at + 3 * v;

        memcpy(p, x, sizeof p);
        for (size_t i = 0; i < m; i++) {
            double k = i < count ? distance3_d(p, c[i].from)
                     : i == count ? 1 : p[i - count - 1];

            for (int d = 0; d < 3; d++)
                x[d] += k * B[3 * i + (size_t)d];
        }
    }
out:
    arena_release(&room);
    return rc;
}

/* ---- points ------------------------------------------------------------- */

/* at (from->V,3) = from's template where to's lies. */
static int map_bend(double *at, struct head_map *m, struct error *err)
{
    struct control c[HEAD_LANDMARKS];
    float a[3 * HEAD_LANDMARKS], b[3 * HEAD_LANDMARKS];

    head_landmarks(a, m->from, m->from->v_template);
    head_landmarks(b, m->to, m->to->v_template);
    for (size_t i = 0; i < HEAD_LANDMARKS; i++)
        for (size_t k = 0; k < 3; k++) {
            c[i].from[k] = a[3 * i + k];
            c[i].to[k] = b[3 * i + k];
            if (i >= INNER)
                m->shift[k] += (b[3 * i + k] - a[3 * i + k]) /
                               (float)(HEAD_LANDMARKS - INNER);
        }
    for (size_t i = 0; i < 3 * m->from->V; i++)
        at[i] = m->from->v_template[i];
    return map_bend_mesh(at, m->from->V, c, HEAD_LANDMARKS, err);
}

/* Whether the face of from at a hit is skin that expressions move. */
static bool map_is_skin(const struct head *h, int32_t face)
{
    const int32_t *f = h->f + 3 * face;

    for (int k = 0; h->region && k < 3; k++)
        if (h->region[f[k]] == REGION_EYEBALL ||
            h->region[f[k]] == REGION_INNER_MOUTH)
            return false;
    return true;
}

/* Vertex v of to is the nearest point of the bent mesh whose normal agrees;
 * any nearest point, untrusted, where none does. */
static void map_find(struct head_map *m, size_t v, const struct nearest *t,
                     const float *normal)
{
    const float *x = m->to->v_template + 3 * v;
    const double p[3] = {x[0], x[1], x[2]};
    struct nearest_hit hit;
    const bool agrees = nearest_facing(&hit, t, p, normal, 4 * NEAR);

    if (hit.face < 0)
        return;
    for (int k = 0; k < 3; k++) {
        m->vertex[3 * v + (size_t)k] = m->from->f[3 * hit.face + k];
        m->weight[3 * v + (size_t)k] = (float)hit.bary[k];
    }
    if (agrees && map_is_skin(m->from, hit.face))
        m->trust[v] = (float)exp(-hit.square / (NEAR * NEAR));
}

/* Each vertex of the one head on the other's surface, which is bent onto it
 * first. */
static int map_points(struct head_map *m, struct error *err)
{
    const size_t n = 3 * m->from->V;
    struct arena *a = &m->memory;
    double *at = arena_take(a, n, sizeof *at);
    float *bent = arena_take(a, n, sizeof *bent);
    float *normals = arena_take(a, 3 * m->to->V, sizeof *normals);
    struct nearest t;

    if (arena_check(a, "a head", err) || map_bend(at, m, err))
        return -1;
    for (size_t i = 0; i < n; i++)
        bent[i] = (float)at[i];
    head_normals(normals, m->to, m->to->v_template);
    if (nearest_init(&t, bent, m->from->f, m->from->F, a, err))
        return -1;
    for (size_t v = 0; v < m->to->V; v++)
        map_find(m, v, &t, normals + 3 * v);
    return 0;
}

void head_map_vertices(float *out, const float *in, size_t width,
                       const struct head_map *m)
{
    for (size_t v = 0; v < m->to->V; v++)
        for (size_t c = 0; c < width; c++) {
            float sum = 0;

            for (size_t k = 3 * v; k < 3 * v + 3; k++)
                sum += m->weight[k] * in[(size_t)m->vertex[k] * width + c];
            out[v * width + c] = sum;
        }
}

/* ---- fits --------------------------------------------------------------- */

/* Displacements of to's vertices, a row of (V,3) for each column of a basis. */
struct map_basis {
    size_t n, len;
    float *row;
};

PARALLEL(map_fit_part, i, const struct map_basis *, T,
         const struct map_basis *, F, double *, A, double *, B,
         const float *, weight, size_t, len, size_t, n, size_t, cols,
         double, slip)
{
    const float *t = T->row + i * len;

    for (size_t j = 0; j <= i; j++)
        for (size_t k = 0; k < len; k++)
            A[i * n + j] += (double)weight[k / 3] * t[k] * T->row[j * len + k];
    A[i * n + i] += slip * slip;
    for (size_t j = 0; j < cols; j++)
        for (size_t k = 0; k < len; k++)
            B[i * cols + j] +=
                (double)weight[k / 3] * t[k] * F->row[j * len + k];
}

/* out (n_to,n_from) = the least squares of sum_v w_v |T c - F|^2 + slip^2
 * |c|^2; weights (to->V) sum to POINTS.  *left: the share of F that is left
 * over, root mean square. */
static int map_fit(float *out, double *left, struct arena *a,
                   const struct map_basis *T, const struct map_basis *F,
                   const float *weight, double slip, struct error *err)
{
    const size_t n = T->n, cols = F->n, len = T->len;
    double *A = arena_take(a, n * n, sizeof *A);
    double *B = arena_take(a, n * cols, sizeof *B);
    double all = 1e-30, over = 0;

    if (arena_check(a, "a head", err))
        return -1;
    parallel_each(map_fit_part, n, 1, T, F, A, B, weight, len, n, cols, slip);
    cholesky_solve_columns(B, A, n, cols);
    for (size_t i = 0; i < n * cols; i++)
        out[i] = (float)B[i];
    for (size_t j = 0; left && j < cols; j++)
        for (size_t k = 0; k < len; k++) {
            double d = F->row[j * len + k];

            all += weight[k / 3] * d * d;
            for (size_t i = 0; i < n; i++)
                d -= B[i * cols + j] * T->row[i * len + k];
            over += weight[k / 3] * d * d;
        }
    if (left)
        *left = sqrt(over / all);
    return 0;
}

/* row (V,3) of h = how far a usual turn of the jaw about axis k moves it; still
 * (V,3) is scratch. */
static int map_jaw(float *row, float *still, const struct head *h, int k,
                   struct error *err)
{
    struct identity id;
    struct head_motion rest = {0}, rotated = {0};

    if (head_fold(&id, h, NULL, 0, err))
        return -1;
    rotated.jaw[k] = JAW;
    head_pose(still, &id, &rest);
    head_pose(row, &id, &rotated);
    for (size_t i = 0; i < 3 * h->V; i++)
        row[i] -= still[i];
    identity_release(&id);
    return 0;
}

/* The first n directions of `dirs` (of which h has `of`), then, with jaw, its
 * turns; on to's vertices.  There is room for one more row. */
static int map_columns(struct map_basis *b, struct head_map *m,
                       const struct head *h, const float *dirs, size_t of,
                       size_t n, bool jaw, struct error *err)
{
    float *own = arena_take(&m->memory, 3 * h->V, sizeof *own);
    float *still = arena_take(&m->memory, 3 * h->V, sizeof *still);

    b->n = n + (jaw ? HEAD_MAP_JAW : 0);
    b->len = 3 * m->to->V;
    b->row = arena_take(&m->memory, (b->n + 1) * b->len, sizeof *b->row);
    if (arena_check(&m->memory, "a head", err))
        return -1;
    for (size_t k = 0; k < b->n; k++) {
        if (k < n)
            head_direction(own, h, dirs, of, k);
        else if (map_jaw(own, still, h, (int)(k - n), err))
            return -1;
        if (h == m->to)
            memcpy(b->row + k * b->len, own, b->len * sizeof *own);
        else
            head_map_vertices(b->row + k * b->len, own, 3, m);
    }
    return 0;
}

/* Expressions and jaw.  The jaw's rows and columns are of its usual turn. */
static int map_fit_motion(struct head_map *m, const float *weight,
                          struct error *err)
{
    struct map_basis T, F;

    if (map_columns(&T, m, m->to, m->to->exp_dirs, m->to->nexp, m->nexp, true,
                    err) ||
        map_columns(&F, m, m->from, m->from->exp_dirs, m->from->nexp,
                    m->from->nexp, true, err) ||
        map_fit(m->motion, &m->error, &m->memory, &T, &F, weight, SLIP_EXP,
                err))
        return -1;
    for (size_t i = 0; i < T.n; i++)
        for (size_t j = 0; j < F.n; j++)
            m->motion[i * F.n + j] *= (i >= m->nexp ? JAW : 1) /
                                      (j >= m->from->nexp ? JAW : 1);
    return 0;
}

/* Shapes, and from's mean head, which is one more column. */
static int map_fit_shape(struct head_map *m, const float *weight,
                         struct error *err)
{
    const size_t n = m->from->nshape;
    struct map_basis T, F;
    float *all = arena_take(&m->memory, m->nshape * (n + 1), sizeof *all);

    if (map_columns(&T, m, m->to, m->to->shape_dirs, m->to->nshape, m->nshape,
                    false, err) ||
        map_columns(&F, m, m->from, m->from->shape_dirs, n, n, false, err))
        return -1;
    float *mean = F.row + n * F.len;

    F.n = n + 1;
    head_map_vertices(mean, m->from->v_template, 3, m);
    for (size_t i = 0; i < F.len; i++)
        mean[i] += m->shift[i % 3] - m->to->v_template[i];
    if (map_fit(all, NULL, &m->memory, &T, &F, weight, SLIP_SHAPE, err))
        return -1;
    for (size_t i = 0; i < m->nshape; i++) {
        memcpy(m->shape + i * n, all + i * (n + 1), n * sizeof *all);
        m->mean[i] = all[i * (n + 1) + n];
    }
    return 0;
}

/* Trust times the vertices' areas would be better; FLAME's and ours are of
 * even density where a face moves. */
static void map_weights(float *w, const struct head_map *m)
{
    double sum = 1e-9;

    for (size_t v = 0; v < m->to->V; v++)
        sum += m->trust[v];
    for (size_t v = 0; v < m->to->V; v++)
        w[v] = (float)(m->trust[v] * POINTS / sum);
}

/* ---- the whole ---------------------------------------------------------- */

int head_map_init(struct head_map *m, const struct head *from,
                  const struct head *to, size_t nexp, size_t nshape,
                  struct error *err)
{
    struct arena *a = &m->memory;

    *m = (struct head_map){
        .from = from, .to = to,
        .nexp = to->nexp < nexp ? to->nexp : nexp,
        .nshape = to->nshape < nshape ? to->nshape : nshape
    };
    if (!from->has_landmarks || !to->has_landmarks)
        return error_set(err, EX_DATAERR, "a head without landmarks cannot be "
                         "laid on another (expected 68)");
    m->vertex = arena_take(a, 3 * to->V, sizeof *m->vertex);
    m->weight = arena_take(a, 3 * to->V, sizeof *m->weight);
    m->trust = arena_take(a, to->V, sizeof *m->trust);
    m->motion = arena_take(a, (m->nexp + 3) * (from->nexp + 3),
                           sizeof *m->motion);
    m->shape = arena_take(a, m->nshape * from->nshape, sizeof *m->shape);
    m->mean = arena_take(a, m->nshape, sizeof *m->mean);
    float *w = arena_take(a, to->V, sizeof *w);
    int rc = arena_check(a, "a head", err) || map_points(m, err) ? -1 : 0;

    if (rc == 0) {
        map_weights(w, m);
        rc = map_fit_motion(m, w, err) || map_fit_shape(m, w, err) ? -1 : 0;
    }
    if (rc)
        head_map_release(m);
    return rc;
}

void head_map_release(struct head_map *m)
{
    arena_release(&m->memory);
    *m = (struct head_map){.from = NULL};
}
