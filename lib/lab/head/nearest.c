/* Boxes halved along their longest axis; what is further away than the best
 * so far is left out. */
#include "lib/lab/head/nearest.h"

#include <math.h>
#include <string.h>

#include "lib/base/rotation.h"

enum { LEAF = 4, DEPTH = 64 };
#define AGREES 0.3              /* cosine of normals of the same skin */

/* Faces order[first .. first + count - 1]; children at `left` and left + 1
 * when that is not 0. */
struct nearest_node {
    float lo[3], hi[3];
    uint32_t first, count, left;
};

static void nearest_centre_of(double c[3], const struct nearest *t,
                              int32_t face)
{
    for (int d = 0; d < 3; d++) {
        c[d] = 0;
        for (int k = 0; k < 3; k++)
            c[d] += t->verts[3 * t->faces[3 * face + k] + d] / 3.0;
    }
}

/* The box about the faces of a node. */
static void nearest_fit_box(struct nearest_node *n, const struct nearest *t)
{
    for (int d = 0; d < 3; d++) {
        n->lo[d] = INFINITY;
        n->hi[d] = -INFINITY;
    }
    for (uint32_t i = n->first; i < n->first + n->count; i++)
        for (int k = 0; k < 3; k++)
            for (int d = 0; d < 3; d++) {
                float x = t->verts[3 * t->faces[3 * t->order[i] + k] + d];

                n->lo[d] = fminf(n->lo[d], x);
                n->hi[d] = fmaxf(n->hi[d], x);
            }
}

void nearest_update(struct nearest *t)
{
    for (size_t i = 0; i < t->nodes; i++)
        nearest_fit_box(&t->node[i], t);
}

/* Faces of n on the lower side of the middle of its longest axis come first;
 * returns how many. */
static uint32_t nearest_partition(struct nearest *t,
                                  const struct nearest_node *n)
{
    int axis = 0;
    uint32_t below = 0;

    for (int d = 1; d < 3; d++)
        if (n->hi[d] - n->lo[d] > n->hi[axis] - n->lo[axis])
            axis = d;
    double mean = 0;
    for (uint32_t i = 0; i < n->count; i++) {
        double c[3];

        nearest_centre_of(c, t, t->order[n->first + i]);
        mean += c[axis] / n->count;
    }
    for (uint32_t i = 0; i < n->count; i++) {
        int32_t *a = &t->order[n->first + i], *b = &t->order[n->first + below];
        double c[3];

        nearest_centre_of(c, t, *a);
        if (c[axis] < mean) {
            int32_t swap = *a;

            *a = *b;
            *b = swap;
            below++;
        }
    }
    return below > 0 && below < n->count ? below : n->count / 2;
}

int nearest_init(struct nearest *t, const float *verts, const int32_t *faces,
                 size_t nf, struct arena *memory, struct error *err)
{
    *t = (struct nearest){.verts = verts, .faces = faces, .nf = nf};
    t->order = arena_take(memory, nf, sizeof *t->order);
    t->node = arena_take(memory, 2 * nf + 1, sizeof *t->node);
    if (arena_check(memory, "a tree of faces", err))
        return -1;
    for (size_t i = 0; i < nf; i++)
        t->order[i] = (int32_t)i;
    t->node[t->nodes++] = (struct nearest_node){.count = (uint32_t)nf};
    for (size_t i = 0; i < t->nodes; i++) {
        struct nearest_node *n = &t->node[i];

        nearest_fit_box(n, t);
        if (n->count <= LEAF)
            continue;
        uint32_t below = nearest_partition(t, n);
        n->left = (uint32_t)t->nodes;
        t->node[t->nodes++] = (struct nearest_node){
            .first = n->first, .count = below};
        t->node[t->nodes++] = (struct nearest_node){
            .first = n->first + below, .count = n->count - below};
    }
    return 0;
}

/* Barycentric coordinates of the point of the segment a b nearest to 0, from
 * a's and b's dot products; *square its distance. */
static double nearest_on_segment(double *square, double aa, double ab,
                                 double bb)
{
    double l = aa - 2 * ab + bb, s = l > 0 ? (aa - ab) / l : 0;

    s = s < 0 ? 0 : s > 1 ? 1 : s;
    *square = (1 - s) * (1 - s) * aa + 2 * s * (1 - s) * ab + s * s * bb;
    return s;
}

/* The point of the triangle with corners x (relative to the point asked for)
 * nearest to 0: inside when the foot of the perpendicular is, else on one of
 * the edges. */
static double nearest_on_triangle(double bary[3], double x[3][3])
{
    double d[3][3], square, best = INFINITY;

    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            d[i][j] = dot3_d(x[i], x[j]);
    /* minimise |x0 + s e1 + t e2|^2 */
    double a = d[1][1] - 2 * d[0][1] + d[0][0];
    double b = d[1][2] - d[0][1] - d[0][2] + d[0][0];
    double c = d[2][2] - 2 * d[0][2] + d[0][0];
    double p = d[0][0] - d[0][1], q = d[0][0] - d[0][2];
    double det = a * c - b * b;
    if (det > 1e-12 * a * c) {
        double s = (c * p - b * q) / det, t = (a * q - b * p) / det;

        if (s >= 0 && t >= 0 && s + t <= 1) {
            bary[0] = 1 - s - t;
            bary[1] = s;
            bary[2] = t;
            return fmax(0, d[0][0] - s * p - t * q);
        }
    }
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3;
        double s = nearest_on_segment(&square, d[i][i], d[i][j], d[j][j]);

        if (square < best) {
            best = square;
            bary[i] = 1 - s;
            bary[j] = s;
            bary[3 - i - j] = 0;
        }
    }
    return best;
}

/* Keep a face that is nearer than the best so far, if its normal agrees (NULL:
 * with any). */
static void nearest_try_face(struct nearest_hit *hit, const struct nearest *t,
                             int32_t face, const double p[3],
                             const double *normal)
{
    double x[3][3], bary[3];

    for (int k = 0; k < 3; k++)
        for (int d = 0; d < 3; d++)
            x[k][d] = t->verts[3 * t->faces[3 * face + k] + d] - p[d];
    double square = nearest_on_triangle(bary, x);
    if (square >= hit->square)
        return;
    if (normal) {
        double u[3], v[3], n[3];

        for (int d = 0; d < 3; d++) {
            u[d] = x[1][d] - x[0][d];
            v[d] = x[2][d] - x[0][d];
        }
        cross3_d(n, u, v);
        if (dot3_d(n, normal) < AGREES * sqrt(dot3_d(n, n)))
            return;
    }
    hit->face = face;
    hit->square = square;
    for (int d = 0; d < 3; d++) {
        hit->bary[d] = bary[d];
        hit->at[d] = p[d] + bary[0] * x[0][d] + bary[1] * x[1][d] +
                     bary[2] * x[2][d];
    }
}

/* Squared distance from a node's box, 0 inside. */
static double nearest_box_square(const struct nearest_node *n,
                                 const double p[3])
{
    double sum = 0;

    for (int d = 0; d < 3; d++) {
        double x = p[d] < n->lo[d] ? n->lo[d] - p[d]
                 : p[d] > n->hi[d] ? p[d] - n->hi[d] : 0;
        sum += x * x;
    }
    return sum;
}

static void nearest_search(struct nearest_hit *hit, const struct nearest *t,
                           const double p[3], const double *normal, double max)
{
    uint32_t stack[2 * DEPTH];
    int top = 0;

    *hit = (struct nearest_hit){.face = -1, .square = max * max};
    stack[top++] = 0;
    while (top > 0) {
        const struct nearest_node *n = &t->node[stack[--top]];

        if (nearest_box_square(n, p) >= hit->square)
            continue;
        if (!n->left || top + 2 > 2 * DEPTH) {
            for (uint32_t i = 0; i < n->count; i++)
                nearest_try_face(hit, t, t->order[n->first + i], p, normal);
            continue;
        }
        uint32_t a = n->left, b = a + 1;
        if (nearest_box_square(&t->node[a], p) <
            nearest_box_square(&t->node[b], p)) {
            uint32_t swap = a;

            a = b;
            b = swap;
        }
        stack[top++] = a;       /* the nearer one is looked at first */
        stack[top++] = b;
    }
}

void nearest_find(struct nearest_hit *hit, const struct nearest *t,
                  const double p[3], double max)
{
    nearest_search(hit, t, p, NULL, max);
}

bool nearest_facing(struct nearest_hit *hit, const struct nearest *t,
                    const double p[3], const float normal[3], double max)
{
    const double n[3] = {normal[0], normal[1], normal[2]};

    nearest_search(hit, t, p, n, max);
    if (hit->face >= 0)
        return true;
    nearest_search(hit, t, p, NULL, INFINITY);
    return false;
}
