/* Bending one template onto the other, nearest points, and two regularised
 * least-squares fits. */
#include "lib/lab/head/map.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/cholesky.h"
#include "lib/base/parallel.h"
#include "lib/head/lbs.h"
#include "lib/lab/head/nearest.h"
#include "lib/lab/head/register.h"

#define INNER 17            /* landmarks before it are the contour */
#define NEAR 0.05           /* 10 mm: trust falls to 1/e at this distance */
#define POINTS 300.0        /* about so many independent points a mesh has */
#define SLIP_EXP 0.0025     /* 0.5 mm: what an expression may leave over */
#define SLIP_SHAPE 0.005    /* 1 mm: what a shape may */
#define JAW 0.2f            /* radians: a usual turn, and the step of its
                             * differences */

/* Memory of n numbers. */
static void *map_floats(size_t n, size_t size, struct error *err)
{
    void *p = calloc(n + 1, size);

    if (!p)
        error_set(err, EX_OSERR, "no memory for %zu numbers", n);
    return p;
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
    return register_bend(at, m->from->V, c, HEAD_LANDMARKS, err);
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
    const double n[3] = {normal[0], normal[1], normal[2]};
    struct nearest_hit hit;
    bool agrees = true;

    nearest_find(&hit, t, p, n, 0.3, 4 * NEAR);
    if (hit.face < 0) {
        agrees = false;
        nearest_find(&hit, t, p, NULL, 0, 1e9);
    }
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
    double *at = map_floats(n, sizeof *at, err);
    float *bent = at ? map_floats(n, sizeof *bent, err) : NULL;
    float *normals = bent ? map_floats(3 * m->to->V, sizeof *normals, err)
                          : NULL;
    struct nearest t = {0};
    int rc = -1;

    if (normals && map_bend(at, m, err) == 0) {
        for (size_t i = 0; i < n; i++)
            bent[i] = (float)at[i];
        head_normals(normals, m->to, m->to->v_template);
        rc = nearest_init(&t, bent, m->from->f, m->from->F, err);
        for (size_t v = 0; rc == 0 && v < m->to->V; v++)
            map_find(m, v, &t, normals + 3 * v);
    }
    nearest_release(&t);
    free(at);
    free(bent);
    free(normals);
    return rc;
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
static int map_fit(float *out, double *left, const struct map_basis *T,
                   const struct map_basis *F, const float *weight,
                   double slip, struct error *err)
{
    const size_t n = T->n, cols = F->n, len = T->len;
    double *A = map_floats(n * n, sizeof *A, err);
    double *B = A ? map_floats(n * cols, sizeof *B, err) : NULL;
    double all = 1e-30, over = 0;

    if (!B) {
        free(A);
        return -1;
    }

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
    free(A);
    free(B);
    return 0;
}

/* row (V,3) of h = how far a usual turn of the jaw about axis k moves it. */
static int map_jaw(float *row, const struct head *h, int k, struct error *err)
{
    struct identity id;
    struct head_motion rest = {0}, rotated = {0};
    float *still = map_floats(3 * h->V, sizeof *still, err);

    if (!still || head_fold(&id, h, NULL, 0, err)) {
        free(still);
        return -1;
    }
    rotated.jaw[k] = JAW;
    head_pose(still, &id, &rest);
    head_pose(row, &id, &rotated);
    for (size_t i = 0; i < 3 * h->V; i++)
        row[i] -= still[i];
    identity_release(&id);
    free(still);
    return 0;
}

/* The first n directions of `dirs` (of which h has `of`), then, with jaw, its
 * turns; on to's vertices. */
static int map_columns(struct map_basis *b, const struct head_map *m,
                       const struct head *h, const float *dirs, size_t of,
                       size_t n, bool jaw, struct error *err)
{
    float *own = map_floats(3 * h->V, sizeof *own, err);
    int rc = 0;

    b->n = n + (jaw ? HEAD_MAP_JAW : 0);
    b->len = 3 * m->to->V;
    b->row = own ? map_floats(b->n * b->len, sizeof *b->row, err) : NULL;
    for (size_t k = 0; b->row && k < b->n && rc == 0; k++) {
        if (k < n)
            head_direction(own, h, dirs, of, k);
        else
            rc = map_jaw(own, h, (int)(k - n), err);
        if (h == m->to)
            memcpy(b->row + k * b->len, own, b->len * sizeof *own);
        else
            head_map_vertices(b->row + k * b->len, own, 3, m);
    }
    free(own);
    return b->row ? rc : -1;
}

/* Expressions and jaw.  The jaw's rows and columns are of its usual turn. */
static int map_fit_motion(struct head_map *m, const float *weight,
                          struct error *err)
{
    struct map_basis T = {0}, F = {0};
    int rc = -1;

    if (map_columns(&T, m, m->to, m->to->exp_dirs, m->to->nexp, m->nexp, true,
                    err) == 0 &&
        map_columns(&F, m, m->from, m->from->exp_dirs, m->from->nexp,
                    m->from->nexp, true, err) == 0)
        rc = map_fit(m->motion, &m->error, &T, &F, weight, SLIP_EXP, err);
    for (size_t i = 0; rc == 0 && i < T.n; i++)
        for (size_t j = 0; j < F.n; j++)
            m->motion[i * F.n + j] *= (i >= m->nexp ? JAW : 1) /
                                      (j >= m->from->nexp ? JAW : 1);
    free(T.row);
    free(F.row);
    return rc;
}

/* Shapes, and from's mean head, which is one more column. */
static int map_fit_shape(struct head_map *m, const float *weight,
                         struct error *err)
{
    const size_t n = m->from->nshape;
    struct map_basis T = {0}, F = {0};
    float *all = map_floats(m->nshape * (n + 1), sizeof *all, err);
    int rc = -1;

    if (all &&
        map_columns(&T, m, m->to, m->to->shape_dirs, m->to->nshape, m->nshape,
                    false, err) == 0 &&
        map_columns(&F, m, m->from, m->from->shape_dirs, n, n, false,
                    err) == 0) {
        float *more = realloc(F.row, (n + 1) * F.len * sizeof *more);

        if (more) {
            float *mean = more + n * F.len;

            F.row = more;
            F.n = n + 1;
            head_map_vertices(mean, m->from->v_template, 3, m);
            for (size_t i = 0; i < F.len; i++)
                mean[i] += m->shift[i % 3] - m->to->v_template[i];
            rc = map_fit(all, NULL, &T, &F, weight, SLIP_SHAPE, err);
        } else {
            error_set(err, EX_OSERR, "no memory for %zu shapes", n);
        }
    }
    for (size_t i = 0; rc == 0 && i < m->nshape; i++) {
        memcpy(m->shape + i * n, all + i * (n + 1), n * sizeof *all);
        m->mean[i] = all[i * (n + 1) + n];
    }
    free(T.row);
    free(F.row);
    free(all);
    return rc;
}

/* Trust times the vertices' areas would be better; FLAME's and ours are of
 * even density where a face moves. */
static float *map_weights(const struct head_map *m, struct error *err)
{
    float *w = map_floats(m->to->V, sizeof *w, err);
    double sum = 1e-9;

    for (size_t v = 0; v < m->to->V; v++)
        sum += m->trust[v];
    for (size_t v = 0; w && v < m->to->V; v++)
        w[v] = (float)(m->trust[v] * POINTS / sum);
    return w;
}

/* ---- the whole ---------------------------------------------------------- */

int head_map_init(struct head_map *m, const struct head *from,
                  const struct head *to, size_t nexp, size_t nshape,
                  struct error *err)
{
    memset(m, 0, sizeof *m);
    m->from = from;
    m->to = to;
    m->nexp = to->nexp < nexp ? to->nexp : nexp;
    m->nshape = to->nshape < nshape ? to->nshape : nshape;
    if (!from->has_landmarks || !to->has_landmarks)
        return error_set(err, EX_DATAERR, "a head without landmarks cannot be "
                         "laid on another (expected 68)");
    m->vertex = map_floats(3 * to->V, sizeof *m->vertex, err);
    m->weight = map_floats(3 * to->V, sizeof *m->weight, err);
    m->trust = map_floats(to->V, sizeof *m->trust, err);
    m->motion = map_floats((m->nexp + 3) * (from->nexp + 3),
                           sizeof *m->motion, err);
    m->shape = map_floats(m->nshape * from->nshape, sizeof *m->shape, err);
    m->mean = map_floats(m->nshape, sizeof *m->mean, err);
    float *w = NULL;
    if (!m->vertex || !m->weight || !m->trust || !m->motion || !m->shape ||
        !m->mean || map_points(m, err) || !(w = map_weights(m, err)) ||
        map_fit_motion(m, w, err) || map_fit_shape(m, w, err)) {
        free(w);
        head_map_release(m);
        return -1;
    }
    free(w);
    return 0;
}

void head_map_release(struct head_map *m)
{
    free(m->vertex);
    free(m->weight);
    free(m->trust);
    free(m->motion);
    free(m->shape);
    free(m->mean);
    memset(m, 0, sizeof *m);
}
