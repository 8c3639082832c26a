/* FLAME's pickles (2019, 2020, 2023) and a landmark embedding as a head file:
 * the arrays keep their names; the lips' rings come from the landmarks, and so
 * do the eyelids where no file has them. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/lab/convert/facepaths.h"
#include "lib/lab/convert/table.h"
#include "lib/head/head.h"

#define MAX_VERTICES 1000000

/* What is made of the files' numbers; outputs are owned by the conversion. */
struct flame {
    struct convert *c;
    struct arena room;
    char prefix[TENSORFILE_NAME];
    size_t V, F, K;
    float *verts;               /* (V,3) */
    int32_t *f;                 /* (F,3), output */
    double *joints;             /* J_regressor (5,V) */
    int32_t *faces;             /* (68), output */
    float *bary;                /* (68,3), output */
};

/* ---- the model's own arrays --------------------------------------------- */

/* Sizes from v_template, f and shapedirs. */
static bool flame_find_sizes(struct flame *m)
{
    const size_t rows[3] = {0, 3, 0};
    struct convert *c = m->c;
    const size_t v = convert_find(c, 0, m->prefix, "v_template", 2, rows,
                                  false);
    const size_t f = convert_find(c, 0, m->prefix, "f", 2, rows, false);
    const size_t s = convert_find(c, 0, m->prefix, "shapedirs", 3, rows,
                                  false);

    if (v == SIZE_MAX || f == SIZE_MAX || s == SIZE_MAX)
        return false;
    m->V = tensorfile_at(c->file[0], v)->dim[0];
    m->F = tensorfile_at(c->file[0], f)->dim[0];
    m->K = tensorfile_at(c->file[0], s)->dim[2];
    if (m->V && m->V <= MAX_VERTICES && m->F && m->F <= 4 * MAX_VERTICES)
        return true;
    convert_note(c, CONVERT_SHAPE, "%zu vertices and %zu faces", m->V, m->F);
    return false;
}

/* Whole numbers in 0 .. limit-1 from `in` to `out`. */
static int flame_whole_numbers(int32_t *out, const double *in, size_t n,
                               size_t limit, const char *name,
                               struct error *err)
{
    for (size_t i = 0; i < n; i++) {
        if (!(in[i] >= 0 && in[i] < (double)limit && in[i] == floor(in[i])))
            return error_set(err, EX_DATAERR, "tensor '%s' at index %zu is "
                             "%g (expected 0 to %zu)", name, i, in[i],
                             limit - 1);
        out[i] = (int32_t)in[i];
    }
    return 0;
}

/* Triangles, whose numbers must be vertices. */
static int flame_take_faces(struct flame *m, struct error *err)
{
    const size_t dim[2] = {m->F, 3};
    size_t i = convert_find(m->c, 0, m->prefix, "f", 2, dim, false);
    double *in = convert_numbers(m->c, 0, i, &m->room, err);

    m->f = in ? convert_add(m->c, "f", ST_I32, 2, dim, err) : NULL;
    return m->f ? flame_whole_numbers(m->f, in, 3 * m->F, m->V, "f", err) : -1;
}

/* kintree_table [2,joints]: the first row are the parents, the root's is
 * 2^32 - 1 or -1. */
static int flame_take_parents(struct flame *m, struct error *err)
{
    const size_t dim[2] = {2, HEAD_JOINTS}, n = HEAD_JOINTS;
    size_t i = convert_find(m->c, 0, m->prefix, "kintree_table", 2, dim,
                            false);
    double *in = i != SIZE_MAX ? convert_numbers(m->c, 0, i, &m->room, err)
                               : NULL;
    int32_t *out;

    if (!in)
        return i == SIZE_MAX ? 0 : -1;
    out = convert_add(m->c, "parents", ST_I32, 1, &n, err);
    for (size_t k = 0; out && k < n; k++)
        out[k] = k ? (int32_t)fmin(fmax(in[k], -1), 100) : -1;
    return out ? 0 : -1;
}

/* The arrays that are copied as they are, but for their types. */
static int flame_take_arrays(struct flame *m, struct error *err)
{
    const size_t verts[2] = {m->V, 3}, shape[3] = {m->V, 3, m->K};
    const size_t pose[3] = {m->V, 3, HEAD_POSE_DIRS};
    const size_t joints[2] = {HEAD_JOINTS, m->V};
    const size_t skin[2] = {m->V, HEAD_JOINTS};
    struct convert *c = m->c;
    char text[24];

    snprintf(text, sizeof text, "%zu", m->K < 300 ? m->K : 300);
    convert_set_meta(c, "nshape", text);
    convert_set_meta(c, "scale", "5");
    return convert_take(c, 0, m->prefix, "v_template", "v_template", 2, verts,
                        err) ||
           flame_take_faces(m, err) ||
           convert_take(c, 0, m->prefix, "shapedirs", "shapedirs", 3, shape,
                        err) ||
           convert_take(c, 0, m->prefix, "posedirs", "posedirs", 3, pose,
                        err) ||
           convert_take(c, 0, m->prefix, "J_regressor", "J_regressor", 2,
                        joints, err) ||
           convert_take(c, 0, m->prefix, "weights", "weights", 2, skin,
                        err) ||
           flame_take_parents(m, err) ? -1 : 0;
}

/* Template and joints as numbers, for what is derived from them. */
static int flame_load_mesh(struct flame *m, struct error *err)
{
    struct convert *c = m->c;
    const size_t verts[2] = {m->V, 3}, joints[2] = {HEAD_JOINTS, m->V};
    size_t v = convert_find(c, 0, m->prefix, "v_template", 2, verts, true);
    size_t j = convert_find(c, 0, m->prefix, "J_regressor", 2, joints, true);
    double *in = convert_numbers(c, 0, v, &m->room, err);

    m->joints = in ? convert_numbers(c, 0, j, &m->room, err) : NULL;
    m->verts = arena_take(&m->room, 3 * m->V, sizeof *m->verts);
    if (!m->joints || arena_check(&m->room, "v_template", err))
        return -1;
    for (size_t i = 0; i < 3 * m->V; i++) {
        m->verts[i] = (float)in[i];
        if (!isfinite(m->verts[i]))
            return error_set(err, EX_DATAERR, "tensor 'v_template' is not "
                             "finite at index %zu", i);
    }
    return 0;
}

/* ---- landmarks ---------------------------------------------------------- */

/* n faces and their barycentric coordinates from tensors of the embedding,
 * `skip` rows into them, to the outputs from `at` on. */
static int flame_take_embedding(struct flame *m, int file, size_t faces,
                                size_t bary, size_t skip, size_t at, size_t n,
                                struct error *err)
{
    double *f = convert_numbers(m->c, file, faces, &m->room, err);
    double *b = f ? convert_numbers(m->c, file, bary, &m->room, err) : NULL;

    if (!b ||
        flame_whole_numbers(m->faces + at, f + skip, n, m->F,
                            tensorfile_at(m->c->file[file], faces)->name, err))
        return -1;
    for (size_t i = 0; i < 3 * n; i++)
        m->bary[3 * at + i] = (float)b[3 * skip + i];
    return 0;
}

/* Frontal row of the contour, which depends on how the head is turned. */
#define CONTOUR 17
#define INNER 51
#define FRONTAL 39

/* All 68, in one table or as 51 fixed ones and the contour from the front. */
static int flame_take_landmarks(struct flame *m, int file, struct error *err)
{
    const size_t n = HEAD_LANDMARKS, all[3] = {1, n, 3};
    const size_t inner[2] = {INNER, 3}, outer[3] = {0, CONTOUR, 3};
    const size_t dim[2] = {n, 3};
    struct convert *c = m->c;
    char at[TENSORFILE_NAME];
    size_t f, b, df, db;

    m->faces = convert_add(c, "landmark_faces", ST_I32, 1, &n, err);
    m->bary = m->faces ? convert_add(c, "landmark_bary", ST_F32, 2, dim, err)
                       : NULL;
    if (!m->bary)
        return -1;
    convert_prefix(at, c, file, "full_lmk_faces_idx");
    f = convert_find(c, file, at, "full_lmk_faces_idx", 2, all, true);
    b = convert_find(c, file, at, "full_lmk_bary_coords", 3, all, true);
    if (f != SIZE_MAX && b != SIZE_MAX)
        return flame_take_embedding(m, file, f, b, 0, 0, n, err);
    convert_prefix(at, c, file, "static_lmk_faces_idx");
    f = convert_find(c, file, at, "static_lmk_faces_idx", 1, inner, false);
    b = convert_find(c, file, at, "static_lmk_bary_coords", 2, inner, false);
    df = convert_find(c, file, at, "dynamic_lmk_faces_idx", 2, outer, false);
    db = convert_find(c, file, at, "dynamic_lmk_bary_coords", 3, outer,
                      false);
    if (f == SIZE_MAX || b == SIZE_MAX || df == SIZE_MAX || db == SIZE_MAX)
        return 0;
    size_t rows = tensorfile_at(c->file[file], df)->dim[0];

    if (rows != tensorfile_at(c->file[file], db)->dim[0] || rows == 0)
        return error_set(err, EX_DATAERR, "contour landmarks of %zu rows",
                         rows);
    if (flame_take_embedding(m, file, df, db,
                             CONTOUR * (rows > FRONTAL ? FRONTAL : 0), 0,
                             CONTOUR, err))
        return -1;
    return flame_take_embedding(m, file, f, b, 0, CONTOUR, INNER, err);
}

/* ---- what follows from the landmarks ------------------------------------ */

/* A closed path along the edges through landmarks, as a list of vertices. */
static int flame_take_ring(struct flame *m, struct face_paths *p,
                           const char *name, const int *landmarks, size_t n,
                           struct error *err)
{
    int32_t *list, *out;
    size_t count;

    if (face_paths_trace(&list, &count, p, landmarks, n, err))
        return -1;
    out = convert_add(m->c, name, ST_I32, 1, &count, err);
    if (out)
        memcpy(out, list, count * sizeof *out);
    return out ? 0 : -1;
}

/* FLAME has no eyelid shapes: they are made from the mesh (face_paths). */
static int flame_derive_eyelids(struct flame *m, struct face_paths *p,
                                struct error *err)
{
    const size_t dim[2] = {m->V, 3};

    for (int side = 0; side < 2; side++) {
        float *out = convert_add(m->c, side ? "r_eyelid" : "l_eyelid",
                                 ST_F32, 2, dim, err);

        if (!out || face_paths_eyelid(out, p, side, err))
            return -1;
    }
    convert_note(m->c, CONVERT_REMARK, "eyelids are made from the landmarks "
                 "(--eyelids takes measured ones)");
    return 0;
}

/* Lips, and lids unless a file has them. */
static int flame_derive(struct flame *m, bool lids, struct error *err)
{
    static const int inner[] = {64, 63, 62, 61, 60, 67, 66, 65, 64};
    static const int outer[] = {54, 53, 52, 51, 50, 49, 48};
    struct face_mesh mesh = {m->V, m->F, m->verts, m->f, m->faces, m->bary,
                             {{0}}};
    struct face_paths p;

    for (int side = 0; side < 2; side++)
        for (int k = 0; k < 3; k++) {
            const double *w = m->joints +
                              (size_t)(JOINT_EYE_LEFT + side) * m->V;
            double sum = 0;

            for (size_t v = 0; v < m->V; v++)
                sum += w[v] * m->verts[3 * v + (size_t)k];
            mesh.eye[side][k] = (float)sum;
        }
    return face_paths_init(&p, &mesh, &m->room, err) ||
           flame_take_ring(m, &p, "lip_inner", inner, 9, err) ||
           flame_take_ring(m, &p, "lip_upper_outer", outer, 7, err) ||
           (lids && flame_derive_eyelids(m, &p, err)) ? -1 : 0;
}

/* ---- eyelids from files ------------------------------------------------- */

/* The lid of one side: by name, or with `alone` the file's only tensor; with
 * or without a first dimension of 1. */
static int flame_take_eyelid(struct flame *m, int file, const char *name,
                             bool alone, struct error *err)
{
    const size_t flat[2] = {m->V, 3}, batch[3] = {1, m->V, 3};
    struct convert *c = m->c;
    char prefix[TENSORFILE_NAME] = "";
    const char *from = alone ? tensorfile_at(c->file[file], 0)->name : name;
    char full[2 * TENSORFILE_NAME];
    size_t i;
    double *in;
    float *out;

    if (!alone)
        convert_prefix(prefix, c, file, name);
    snprintf(full, sizeof full, "%s%s", prefix, from);
    i = tensorfile_find(c->file[file], full);
    i = i != SIZE_MAX && tensorfile_at(c->file[file], i)->ndim == 3
            ? convert_find(c, file, prefix, from, 3, batch, false)
            : convert_find(c, file, prefix, from, 2, flat, false);
    if (i == SIZE_MAX)
        return 0;
    in = convert_numbers(c, file, i, &m->room, err);
    out = in ? convert_add(c, name, ST_F32, 2, flat, err) : NULL;
    for (size_t k = 0; out && k < 3 * m->V; k++)
        out[k] = (float)in[k];
    return out ? 0 : -1;
}

/* FILE, or LEFT,RIGHT. */
static int flame_take_eyelids(struct flame *m, const char *path,
                              struct error *err)
{
    const char *comma = strchr(path, ',');
    char *left = comma ? strndup(path, (size_t)(comma - path)) : NULL;
    int a = convert_open(m->c, left ? left : path, err);
    int b = a < 0 || !comma ? a : convert_open(m->c, comma + 1, err);

    free(left);
    if (a < 0 || b < 0)
        return -1;
    for (int k = 0; comma && k < 2; k++) {
        int file = k ? b : a;

        if (tensorfile_count(m->c->file[file]) != 1)
            return error_set(err, EX_DATAERR, "%s: holds %zu tensors "
                             "(expected one eyelid)",
                             tensorfile_path(m->c->file[file]),
                             tensorfile_count(m->c->file[file]));
    }
    return flame_take_eyelid(m, a, "l_eyelid", comma != NULL, err) ||
           flame_take_eyelid(m, b, "r_eyelid", comma != NULL, err) ? -1 : 0;
}

/* ---- the whole ---------------------------------------------------------- */

/* All of a FLAME head; 0 without doing anything when its sizes cannot be
 * told. */
static int flame_convert(struct flame *m, struct error *err)
{
    const struct convert_options *with = m->c->with;
    int file = 0;

    convert_prefix(m->prefix, m->c, 0, "v_template");
    if (!flame_find_sizes(m))
        return 0;
    if (flame_take_arrays(m, err))
        return -1;
    if (with->landmarks &&
        (file = convert_open(m->c, with->landmarks, err)) < 0)
        return -1;
    if (flame_take_landmarks(m, file, err) ||
        (with->eyelids && flame_take_eyelids(m, with->eyelids, err)))
        return -1;
    if (m->c->wrong) {
        if (!with->landmarks)
            convert_note(m->c, CONVERT_REMARK, "landmarks are a file of "
                         "their own (expected --landmarks FILE)");
        return 0;
    }
    return flame_load_mesh(m, err) || flame_derive(m, !with->eyelids, err)
               ? -1 : 0;
}

int convert_flame(struct convert *c, struct error *err)
{
    struct flame m = {.c = c};
    int rc = flame_convert(&m, err);

    arena_release(&m.room);
    return rc;
}
