/* The arrays of a head's file, one by one, on the subdivided mesh. */
#include "lib/lab/head/subdivide.h"

#include <string.h>

#include "lib/base/densify.h"
#include "lib/lab/head/headfile.h"

struct subdivide {
    struct headfile file;
    struct head h;              /* the same file, checked */
    struct densify d;
    struct error *err;
};

/* Room for a tensor of the finer head; NULL and s->err. */
static void *subdivide_add(struct subdivide *s, const char *name,
                           enum st_dtype type, size_t a, size_t b, size_t c)
{
    return headfile_add(&s->file, name, type, a, b, c, s->err);
}

/* Numbers of vertices, (V,width) or (V,3,width / 3): each midpoint's mean. */
static int subdivide_means(struct subdivide *s, const char *name,
                           const float *x, size_t width, bool dirs)
{
    float *out = subdivide_add(s, name, ST_F32, s->d.V + s->d.E,
                               dirs ? 3 : width > 1 ? width : 0,
                               dirs ? width / 3 : 0);

    if (out)
        densify_forward(out, x, &s->d, width);
    return out ? 0 : -1;
}

/* A tensor of rows of vertices. */
static int subdivide_rows(struct subdivide *s, const struct st_tensor *t)
{
    float *x = arena_keep(&s->file.memory,
                          st_load_f32(s->file.st, t->name, t->ndim, t->dim,
                                      NULL, s->err), s->err);

    return x ? subdivide_means(s, t->name, x, t->count / s->d.V, false) : -1;
}

static int subdivide_directions(struct subdivide *s)
{
    const size_t K = s->h.nshape + s->h.nexp, fine = s->d.V + s->d.E;
    float *shape = headfile_directions(&s->file, "shapedirs", s->d.V, K,
                                       s->err);

    headfile_drop(&s->file, "shapedirs");
    headfile_drop(&s->file, "posedirs");
    if (!shape || subdivide_means(s, "shapedirs", shape, 3 * K, true))
        return -1;
    if (!s->h.jaw_shape)        /* zeros */
        return subdivide_add(s, "posedirs", ST_F32, fine, 3, HEAD_POSE_DIRS)
                   ? 0 : -1;
    float *pose = headfile_directions(&s->file, "posedirs", s->d.V,
                                      HEAD_POSE_DIRS, s->err);

    return pose ? subdivide_means(s, "posedirs", pose, 3 * HEAD_POSE_DIRS,
                                  true) : -1;
}

/* The midpoint of an edge, by bisection. */
static int32_t subdivide_middle(const struct densify *d, int32_t a, int32_t b)
{
    const int32_t low = a < b ? a : b, high = a < b ? b : a;
    size_t first = 0, last = d->E;

    while (first + 1 < last) {
        const size_t at = (first + last) / 2;
        const int32_t *e = d->edge + 2 * at;

        if (e[0] < low || (e[0] == low && e[1] <= high))
            first = at;
        else
            last = at;
    }
    return (int32_t)(d->V + first);
}

/* Of each face its corners' (0 to 2), then the middle one; a landmark's is
 * that in which it lies. */
static int subdivide_faces(struct subdivide *s)
{
    const struct head *h = &s->h;
    int32_t *f = subdivide_add(s, "f", ST_I32, 4 * h->F, 3, 0);
    int32_t *face = subdivide_add(s, "landmark_faces", ST_I32, HEAD_LANDMARKS,
                                  0, 0);
    float *bary = subdivide_add(s, "landmark_bary", ST_F32, HEAD_LANDMARKS, 3,
                                0);

    if (!f || !face || !bary)
        return -1;
    for (size_t i = 0; i < h->F; i++)
        for (size_t k = 0; k < 3; k++) {
            const int32_t *v = h->f + 3 * i;
            const int32_t next = subdivide_middle(&s->d, v[k], v[(k + 1) % 3]);
            int32_t *corner = f + 12 * i + 3 * k;

            corner[0] = v[k];
            corner[1] = next;
            corner[2] = subdivide_middle(&s->d, v[k], v[(k + 2) % 3]);
            f[12 * i + 9 + k] = next;
        }
    for (size_t i = 0; i < HEAD_LANDMARKS; i++) {
        const float *b = h->landmark_bary + 3 * i;
        size_t k = 0;

        while (k < 3 && b[k] < 0.5f)
            k++;
        face[i] = 4 * h->landmark_faces[i] + (int32_t)k;
        for (size_t j = 0; j < 3; j++)
            bary[3 * i + j] = k == 3 ? 1 - 2 * b[(j + 2) % 3]
                            : j == 0 ? 2 * b[k] - 1 : 2 * b[(k + j) % 3];
    }
    return 0;
}

/* Joints by the vertices of old; a midpoint's region is its first end's. */
static int subdivide_joints(struct subdivide *s)
{
    const size_t V = s->d.V, fine = V + s->d.E, dims[2] = {HEAD_JOINTS, V};
    float *x = arena_keep(&s->file.memory,
                          st_load_f32(s->file.st, "J_regressor", 2, dims, NULL,
                                      s->err), s->err);
    float *out = x ? subdivide_add(s, "J_regressor", ST_F32, HEAD_JOINTS, fine,
                                   0) : NULL;

    for (size_t j = 0; out && j < HEAD_JOINTS; j++)
        memcpy(out + j * fine, x + j * V, V * sizeof *out);
    if (!out || !s->h.region)
        return out ? 0 : -1;
    int32_t *region = subdivide_add(s, "region", ST_I32, fine, 0, 0);

    for (size_t k = 0; region && k < fine; k++) {
        size_t end[2];

        densify_ends(end, &s->d, k);
        region[k] = s->h.region[end[0]];
    }
    return region ? 0 : -1;
}

/* The places in the lids' lists of the ends of k / 2, on side k % 2, plus 1;
 * 0 beside the lid.  False where both are. */
static bool subdivide_lid(size_t lid[2], const struct densify *d,
                          const size_t *at, size_t k)
{
    size_t end[2];

    densify_ends(end, d, k / 2);
    for (int i = 0; i < 2; i++)
        lid[i] = at[2 * end[i] + k % 2];
    return lid[0] || lid[1];
}

/* What shapes add to the lids: of vertices, and of edges that have an end among
 * them. */
static int subdivide_lids(struct subdivide *s)
{
    const struct head *h = &s->h;
    const size_t fine = s->d.V + s->d.E, m = 3 * h->nlid_shape;
    size_t *at = arena_take(&s->file.memory, 2 * s->d.V, sizeof *at), lid[2], n = 0;

    if (h->nlid == 0)
        return 0;
    for (size_t i = 0; at && i < h->nlid; i++)
        at[2 * h->lid_vertices[i] + h->lid_sides[i]] = i + 1;
    for (size_t k = 0; at && k < 2 * fine; k++)
        n += subdivide_lid(lid, &s->d, at, k);
    int32_t *vertex = subdivide_add(s, "lid_vertices", ST_I32, n, 0, 0);
    int32_t *side = subdivide_add(s, "lid_sides", ST_I32, n, 0, 0);
    float *out = subdivide_add(s, "lid_shapedirs", ST_F32, n, 3,
                               h->nlid_shape);
    if (!at || !vertex || !side || !out)
        return -1;
    for (size_t k = 0; k < 2 * fine; k++) {
        if (!subdivide_lid(lid, &s->d, at, k))
            continue;
        for (int e = 0; e < 2; e++)
            for (size_t i = 0; lid[e] && i < m; i++)
                out[i] += 0.5f / h->scale *
                          h->lid_shapedirs[(lid[e] - 1) * m + i];
        out += m;
        *vertex++ = (int32_t)(k / 2);
        *side++ = (int32_t)(k % 2);
    }
    return 0;
}

/* Lists of vertices and joints stay. */
static int subdivide_all(struct subdivide *s)
{
    static const char *const rows[] = {"v_template", "weights", "l_eyelid",
                                       "r_eyelid", "hair", "uv", NULL};
    const struct st_tensor *t;

    for (size_t i = 0; rows[i]; i++)
        if ((t = st_find(s->file.st, rows[i])) && subdivide_rows(s, t))
            return -1;
    return subdivide_directions(s) || subdivide_faces(s) ||
           subdivide_joints(s) || subdivide_lids(s) ? -1 : 0;
}

int subdivide_head(const char *to, const char *from, struct error *err)
{
    struct subdivide s = {.err = err};
    int rc = -1;

    if (head_load(&s.h, from, err) == 0 &&
        headfile_open(&s.file, from, err) == 0 &&
        densify_init(&s.d, s.h.f, s.h.F, s.h.V, err) == 0 &&
        subdivide_all(&s) == 0)
        rc = headfile_save(&s.file, to, err);
    headfile_close(&s.file);
    densify_release(&s.d);
    head_release(&s.h);
    return rc;
}

bool subdivide_extends(const struct head *fine, const struct head *coarse)
{
    const size_t blocks = coarse->V / HEAD_BLOCK * 3 * HEAD_BLOCK;

    return fine->V > coarse->V && fine->scale == coarse->scale &&
           fine->nshape == coarse->nshape && fine->nexp == coarse->nexp &&
           !memcmp(fine->v_template, coarse->v_template,
                   3 * coarse->V * sizeof(float)) &&
           !memcmp(fine->weights, coarse->weights,
                   HEAD_JOINTS * coarse->V * sizeof(float)) &&
           !memcmp(fine->shape_dirs, coarse->shape_dirs,
                   blocks * coarse->nshape * sizeof(float)) &&
           !memcmp(fine->exp_dirs, coarse->exp_dirs,
                   blocks * coarse->nexp * sizeof(float));
}
