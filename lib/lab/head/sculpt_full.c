/* From the half to the whole: relaxation on the base surface, mirroring,
 * triangles, neighbours and normals. */
#include "lib/lab/head/sculpt_impl.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

/* ---- relaxation of the half --------------------------------------------- */

/* Neighbour lists of the half's quads, each edge once per direction. */
struct links { int n[HALF_VERTS]; int to[HALF_VERTS][20]; };

static void sculpt_link(struct links *l, int a, int b)
{
    for (int i = 0; i < l->n[a]; i++)
        if (l->to[a][i] == b)
            return;
    if (l->n[a] < 20)
        l->to[a][l->n[a]++] = b;
}

/* Edges of the half's faces, both ways. */
static void sculpt_make_links(struct links *l, const struct half *h)
{
    memset(l->n, 0, sizeof l->n);
    for (int q = 0; q < h->nq; q++) {
        int n = h->quad[q][3] < 0 ? 3 : 4;
        for (int i = 0; i < n; i++) {
            int a = h->quad[q][i], b = h->quad[q][(i + 1) % n];
            sculpt_link(l, a, b);
            sculpt_link(l, b, a);
        }
    }
}

/* Mean of the neighbours; on the midline also of their mirror images. */
static struct vec sculpt_links_mean(const struct half *h, const struct links *l,
                                    int v)
{
    struct vec s = vec(0, 0, 0);
    double w = 0;

    for (int i = 0; i < l->n[v]; i++) {
        int u = l->to[v][i];
        double k = h->seam[v] && !h->seam[u] ? 2 : 1;
        s = add(s, mul(h->p[u], k));
        w += k;
    }
    s = mul(s, 1 / w);
    if (h->seam[v])
        s.x = 0;
    return s;
}

/* Even out the vertices that are not authored, keeping them on the base
 * surface as far as they follow it. */
static void sculpt_half_relax(struct half *h, const struct links *l, int rounds)
{
    for (int n = 0; n < rounds; n++)
        for (int v = 0; v < h->nv; v++) {
            if (h->hold[v] >= 1 || h->part[v] == PART_BALL)
                continue;
            bool cut = h->part[v] == PART_GRID && h->row[v] == 0;
            double y = h->p[v].y;
            struct vec p = lerp(h->p[v], sculpt_links_mean(h, l, v),
                                0.5 * (1 - h->hold[v]));
            if (h->snap[v] > 0)
                p = lerp(p, sculpt_surface_project(p), h->snap[v]);
            if (h->seam[v])
                p.x = 0;
            if (cut)
                p.y = y;
            h->p[v] = p;
        }
}

/* Authored dents along the normal of the free skin. */
static void sculpt_add_details(struct half *h)
{
    for (int v = 0; v < h->nv; v++) {
        if (h->snap[v] <= 0 || h->part[v] == PART_BALL)
            continue;
        double d = sculpt_surface_detail(h->p[v]) * h->snap[v];
        struct vec n = unit(sculpt_surface_normal(h->p[v]));
        if (h->seam[v])
            n.x = 0;
        h->p[v] = add(h->p[v], mul(n, d));
    }
}

/* Cheek, jaw and throat come out of the base surface with more relief than
 * skin has: even them out. */
static void sculpt_half_soften(struct half *h, const struct links *l,
                               int rounds)
{
    for (int n = 0; n < rounds; n++)
        for (int v = 0; v < h->nv; v++) {
            struct vec p = h->p[v];
            double w = ramp(24, 44, p.x + 0.25 * fmax(0, 70 - p.z)) *
                       ramp(22, 8, p.y) * ramp(-150, -120, p.y);
            if (h->snap[v] <= 0 || h->hold[v] > 0.4 ||
                h->part[v] == PART_EYE || w <= 0 || h->row[v] == 0)
                continue;
            h->p[v] = lerp(p, sculpt_links_mean(h, l, v), 0.5 * w);
            if (h->seam[v])
                h->p[v].x = 0;
        }
}

/* Loops and grid, authored parts, then all of it evened out. */
static int sculpt_half(struct half *h)
{
    struct links *l = malloc(sizeof *l);

    if (!l)
        return -1;
    sculpt_topology(h);
    sculpt_grid_guess(h);
    sculpt_nostril(h);
    sculpt_ear(h);
    sculpt_eye(h);
    sculpt_lips(h);
    sculpt_make_links(l, h);
    sculpt_half_relax(h, l, 14);
    sculpt_add_details(h);
    sculpt_half_soften(h, l, 12);
    free(l);
    return 0;
}

/* ---- the whole -------------------------------------------------------- */

static void sculpt_put_triangle(struct full *m, int a, int b, int c)
{
    int *f = m->f[m->nf++];

    f[0] = a, f[1] = b, f[2] = c;
}

/* Both sides of a quad, cut along its shorter diagonal. */
static void sculpt_put_quad(struct full *m, const int *q, const int *mir)
{
    const struct vec *p = m->p;

    if (q[3] < 0) {
        sculpt_put_triangle(m, q[0], q[1], q[2]);
        sculpt_put_triangle(m, mir[q[0]], mir[q[2]], mir[q[1]]);
        return;
    }
    int s = norm(sub(p[q[0]], p[q[2]])) > norm(sub(p[q[1]], p[q[3]])) + 1e-9;
    int a = q[s], b = q[s + 1], c = q[s + 2], d = q[(s + 3) % 4];
    sculpt_put_triangle(m, a, b, c);
    sculpt_put_triangle(m, a, c, d);
    sculpt_put_triangle(m, mir[a], mir[c], mir[b]);
    sculpt_put_triangle(m, mir[a], mir[d], mir[c]);
}

/* Unit normals of the vertices, faces by their area. */
static void sculpt_make_normals(struct full *m)
{
    for (int i = 0; i < m->nf; i++) {
        const int *f = m->f[i];
        struct vec n = cross(sub(m->p[f[1]], m->p[f[0]]),
                             sub(m->p[f[2]], m->p[f[0]]));
        for (int k = 0; k < 3; k++)
            m->n[f[k]] = add(m->n[f[k]], n);
    }
    for (int v = 0; v < m->nv; v++)
        m->n[v] = unit(m->n[v]);
}

/* Neighbours by edge, each once, in the order the faces name them. */
static int sculpt_make_neighbours(struct full *m)
{
    int *count = calloc((size_t)m->nv + 1, sizeof *count);
    int *list = malloc((size_t)m->nf * 6 * sizeof *list);

    m->nbr_at = malloc(((size_t)m->nv + 1) * sizeof *m->nbr_at);
    m->nbr = list;
    if (!count || !list || !m->nbr_at) {
        free(count);
        return -1;
    }
    for (int i = 0; i < m->nf; i++)
        for (int k = 0; k < 3; k++)
            count[m->f[i][k]] += 2;
    m->nbr_at[0] = 0;
    for (int v = 0; v < m->nv; v++)
        m->nbr_at[v + 1] = m->nbr_at[v] + count[v];
    memset(count, 0, ((size_t)m->nv + 1) * sizeof *count);
    for (int i = 0; i < m->nf; i++)
        for (int k = 0; k < 6; k++) {
            int a = m->f[i][k / 2], b = m->f[i][(k / 2 + 1 + k % 2) % 3], j;
            int *l = list + m->nbr_at[a];
            for (j = 0; j < count[a] && l[j] != b; j++)
                ;
            if (j == count[a])
                l[count[a]++] = b;
        }
    int n = 0;
    for (int v = 0; v < m->nv; v++) {
        int at = m->nbr_at[v];
        m->nbr_at[v] = n;
        memmove(list + n, list + at, (size_t)count[v] * sizeof *list);
        n += count[v];
    }
    m->nbr_at[m->nv] = n;
    free(count);
    return 0;
}

int sculpt_full_init(struct full *m, const struct half *h)
{
    size_t cap = 2 * HALF_VERTS;

    memset(m, 0, sizeof *m);
    m->h = h;
    m->nhalf = h->nv;
    m->p = calloc(cap, sizeof *m->p);
    m->n = calloc(cap, sizeof *m->n);
    m->f = calloc(4 * HALF_QUADS, sizeof *m->f);
    m->src = calloc(cap, sizeof *m->src);
    m->mirror = calloc(cap, sizeof *m->mirror);
    m->side = calloc(cap, sizeof *m->side);
    if (!m->p || !m->n || !m->f || !m->src || !m->mirror || !m->side)
        return -1;
    m->nv = h->nv;
    for (int v = 0; v < h->nv; v++) {
        int w = h->seam[v] ? v : m->nv++;
        m->p[v] = h->p[v];
        m->p[w] = vec(v == w ? 0 : -h->p[v].x, h->p[v].y, h->p[v].z);
        m->src[v] = m->src[w] = v;
        m->mirror[v] = w;
        m->mirror[w] = v;
        m->side[v] = v == w ? 0 : 1;
        m->side[w] = v == w ? 0 : -1;
    }
    for (int q = 0; q < h->nq; q++)
        sculpt_put_quad(m, h->quad[q], m->mirror);
    sculpt_make_normals(m);
    return sculpt_make_neighbours(m);
}

void sculpt_full_release(struct full *m)
{
    free(m->p);
    free(m->n);
    free(m->f);
    free(m->src);
    free(m->mirror);
    free(m->side);
    free(m->nbr_at);
    free(m->nbr);
    memset(m, 0, sizeof *m);
}

/* ---- the file's arrays --------------------------------------------------- */

static void *sculpt_array(size_t n, size_t size)
{
    return calloc(n ? n : 1, size);
}

/* Every array of the sculpted head, zeroed. */
static int sculpt_allocate(struct sculpt *s, const struct full *m)
{
    size_t v = s->nv = (size_t)m->nv;

    s->nf = (size_t)m->nf;
    s->v_template = sculpt_array(v * 3, sizeof *s->v_template);
    s->f = sculpt_array(s->nf * 3, sizeof *s->f);
    s->shapedirs = sculpt_array(v * 3 * (SCULPT_SHAPES + SCULPT_EXPRESSIONS),
                                sizeof *s->shapedirs);
    s->posedirs = sculpt_array(v * 3 * SCULPT_POSES, sizeof *s->posedirs);
    s->j_regressor = sculpt_array(v * SCULPT_JOINTS, sizeof *s->j_regressor);
    s->weights = sculpt_array(v * SCULPT_JOINTS, sizeof *s->weights);
    s->l_eyelid = sculpt_array(v * 3, sizeof *s->l_eyelid);
    s->r_eyelid = sculpt_array(v * 3, sizeof *s->r_eyelid);
    s->lip_inner = sculpt_array(2 * MOUTH_N, sizeof *s->lip_inner);
    s->lip_upper_outer = sculpt_array(2 * MOUTH_N, sizeof *s->lip_upper_outer);
    s->region = sculpt_array(v, sizeof *s->region);
    s->mirror = sculpt_array(v, sizeof *s->mirror);
    s->hair = sculpt_array(v, sizeof *s->hair);
    s->uv = sculpt_array(v * 2, sizeof *s->uv);
    return s->v_template && s->f && s->shapedirs && s->posedirs &&
           s->j_regressor && s->weights && s->l_eyelid && s->r_eyelid &&
           s->lip_inner && s->lip_upper_outer && s->region && s->mirror &&
           s->hair && s->uv ? 0 : -1;
}

/* Positions of both sides from the half. */
static void sculpt_copy_positions(struct sculpt *s, const struct full *m)
{
    for (int v = 0; v < m->nv; v++) {
        struct vec p = m->h->p[m->src[v]];
        s->v_template[v * 3] = (float)(m->side[v] * p.x * 1e-3);
        s->v_template[v * 3 + 1] = (float)(p.y * 1e-3);
        s->v_template[v * 3 + 2] = (float)(p.z * 1e-3);
    }
}

static void sculpt_copy_mesh(struct sculpt *s, const struct full *m)
{
    sculpt_copy_positions(s, m);
    for (int v = 0; v < m->nv; v++)
        s->mirror[v] = m->mirror[v];
    for (int i = 0; i < m->nf; i++)
        for (int k = 0; k < 3; k++)
            s->f[i * 3 + k] = m->f[i][k];
}

int sculpt_make(struct sculpt *s, struct error *err)
{
    struct half *h = malloc(sizeof *h);
    struct full m = { 0 };

    memset(s, 0, sizeof *s);
    int rc = h && !sculpt_half(h) && !sculpt_full_init(&m, h) &&
             !sculpt_allocate(s, &m) ? 0 : -1;
    if (rc == 0) {
        sculpt_copy_mesh(s, &m);
        rc = sculpt_labels(s, &m) || sculpt_rig(s, &m) ||
             sculpt_shapes(s, &m) || sculpt_expressions(s, &m) ||
             sculpt_finish(h) ? -1 : 0;
        sculpt_copy_positions(s, &m);
    }
    sculpt_full_release(&m);
    free(h);
    return rc ? error_set(err, EX_OSERR, "out of memory for the head") : 0;
}

void sculpt_release(struct sculpt *s)
{
    free(s->v_template);
    free(s->f);
    free(s->shapedirs);
    free(s->posedirs);
    free(s->j_regressor);
    free(s->weights);
    free(s->l_eyelid);
    free(s->r_eyelid);
    free(s->lip_inner);
    free(s->lip_upper_outer);
    free(s->region);
    free(s->mirror);
    free(s->hair);
    free(s->uv);
    free(s->lid_vertices);
    free(s->lid_sides);
    free(s->lid_shapedirs);
    memset(s, 0, sizeof *s);
}
