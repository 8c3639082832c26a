/* ICT-FaceKit's whole mesh read, and split where texture coordinates part. */
#include "lib/lab/people/scan_face.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/safetensors.h"
#include "lib/head/arkit.h"
#include "lib/lab/people/scan_json.h"
#include "lib/lab/people/vec.h"

#define EXPRESSIONS 57          /* in the file: ours, and four more */

static int face_memory(struct error *err)
{
    return error_set(err, EX_OSERR, "out of memory for the scans");
}

/* ---- faces -------------------------------------------------------------- */

struct quads {
    int32_t *v, *t, *part;      /* (n,4) (n,4) (n) */
    float *uv;                  /* (nuv,2) */
    size_t n, nuv;
};

/* The scans' quads, their texture places and parts, all within range. */
static int face_quads_load(struct quads *q, const struct safetensors *st,
                           struct error *err)
{
    size_t two[2] = {0, 4}, n, m, pairs[2] = {0, 2};

    q->v = st_load_i32(st, "quads", 2, two, &n, err);
    if (!q->v)
        return -1;
    two[0] = q->n = n / 4;
    q->t = st_load_i32(st, "quads_uv", 2, two, &m, err);
    q->part = st_load_i32(st, "material", 1, &q->n, &m, err);
    q->uv = st_load_f32(st, "uv", 2, pairs, &q->nuv, err);
    if (!q->t || !q->part || !q->uv)
        return -1;
    q->nuv /= 2;
    for (size_t i = 0; i < 4 * q->n; i++)
        if (q->v[i] < 0 || q->v[i] >= FACE_VERTICES || q->t[i] < 0
            || (size_t)q->t[i] >= q->nuv)
            return error_set(err, EX_DATAERR, "quads: %zu is corner %d of %d "
                             "(expected less than %d and %zu)", i / 4,
                             q->v[i], q->t[i], FACE_VERTICES, q->nuv);
    for (size_t i = 0; i < q->n; i++)
        if (q->part[i] < 0 || q->part[i] >= PART_COUNT)
            return error_set(err, EX_DATAERR, "material: %zu is %d (expected "
                             "0 to %d)", i, q->part[i], PART_COUNT - 1);
    return 0;
}

static void face_quads_release(struct quads *q)
{
    free(q->v);
    free(q->t);
    free(q->part);
    free(q->uv);
}

/* The corner of vertex v at coordinate t: each t has one vertex, mostly. */
static int32_t face_corner_of(struct scan_face *f, const struct quads *q,
                              int32_t *of_uv, int32_t v, int32_t t)
{
    int32_t c = of_uv[t];

    if (c >= 0 && f->source[c] == v)
        return c;
    c = (int32_t)f->nc++;
    of_uv[t] = c;
    f->source[c] = v;
    f->uv[2 * c] = q->uv[2 * t] - floorf(q->uv[2 * t]);
    f->uv[2 * c + 1] = q->uv[2 * t + 1];
    return c;
}

/* Triangles of the quads, corners shared where vertex and place agree. */
static int face_make_faces(struct scan_face *f, const struct quads *q,
                           struct error *err)
{
    int32_t *of_uv = malloc(q->nuv * sizeof *of_uv);

    f->source = malloc(4 * q->n * sizeof *f->source);
    f->uv = malloc(8 * q->n * sizeof *f->uv);
    f->faces = malloc(6 * q->n * sizeof *f->faces);
    f->raw = malloc(6 * q->n * sizeof *f->raw);
    f->part = malloc(2 * q->n);
    if (!of_uv || !f->source || !f->uv || !f->faces || !f->raw || !f->part) {
        free(of_uv);
        return face_memory(err);
    }
    for (size_t i = 0; i < q->nuv; i++)
        of_uv[i] = -1;
    for (size_t i = 0; i < q->n; i++) {
        const int32_t *v = q->v + 4 * i, *t = q->t + 4 * i;
        for (int half = 0; half < 2; half++) {
            int k[3] = {0, 1 + half, 2 + half};
            if (v[k[0]] == v[k[1]] || v[k[1]] == v[k[2]]
                || v[k[2]] == v[k[0]])
                continue;
            for (int c = 0; c < 3; c++) {
                f->faces[3 * f->nf + (size_t)c]
                    = face_corner_of(f, q, of_uv, v[k[c]], t[k[c]]);
                f->raw[3 * f->nf + (size_t)c] = v[k[c]];
            }
            f->part[f->nf++] = (uint8_t)q->part[i];
        }
    }
    free(of_uv);
    return 0;
}

/* ---- shapes ------------------------------------------------------------- */

/* The row of the file's shape `name`. */
static int face_find_row(const cJSON *names, const char *name,
                         struct error *err)
{
    int i = 0;
    const cJSON *n;

    cJSON_ArrayForEach(n, names) {
        if (cJSON_IsString(n) && !strcmp(n->valuestring, name))
            return i;
        i++;
    }
    return error_set(err, EX_DATAERR, "expression_names: no %s (expected "
                     "it)", name);
}

/* Those that ARKit names, in its order, and the pupils' widening. */
static int face_load_expressions(struct scan_face *f,
                                 const struct safetensors *st,
                                 struct error *err)
{
    size_t dims[3] = {EXPRESSIONS, FACE_VERTICES, 3}, n;
    size_t one = 3 * (size_t)FACE_VERTICES;
    const char *text = st_meta(st, "expression_names");
    cJSON *names = text ? cJSON_Parse(text) : NULL;
    float *all = st_load_f32(st, "expression", 3, dims, &n, err);
    int rc = all ? 0 : -1;

    f->expression = malloc(ARKIT_COUNT * one * sizeof *f->expression);
    f->dilate = malloc(2 * one * sizeof *f->dilate);
    if (!rc && !cJSON_IsArray(names))
        rc = error_set(err, EX_DATAERR, "metadata has no expression_names "
                       "(expected a list)");
    if (!rc && (!f->expression || !f->dilate))
        rc = face_memory(err);
    for (int k = 0; !rc && k < ARKIT_COUNT + 2; k++) {
        const char *name = k < ARKIT_COUNT ? arkit_name(k)
                           : k == ARKIT_COUNT ? "PupilDilate_L"
                                              : "PupilDilate_R";
        int row = face_find_row(names, name, err);
        float *to = k < ARKIT_COUNT ? f->expression + (size_t)k * one
                                    : f->dilate
                                      + (size_t)(k - ARKIT_COUNT) * one;
        if (row < 0 || row >= EXPRESSIONS) {
            rc = -1;
            break;
        }
        for (size_t i = 0; i < one; i++)
            to[i] = FACE_UNIT * all[(size_t)row * one + i];
    }
    cJSON_Delete(names);
    free(all);
    return rc;
}

static int face_load_identities(struct scan_face *f,
                                const struct safetensors *st, struct error *err)
{
    size_t dims[3] = {SCAN_IDENTITIES, FACE_VERTICES, 3}, n;

    f->identity = st_load_f32(st, "identity", 3, dims, &n, err);
    if (!f->identity)
        return -1;
    for (size_t i = 0; i < n; i++)
        f->identity[i] *= FACE_UNIT;
    return 0;
}

void scan_face_find_eyes(struct scan_face *f)
{
    for (int e = 0; e < 2; e++) {
        double c[3], axis[3];
        scan_eye(c, e);
        scan_eye_axis(axis, e);
        for (int k = 0; k < 3; k++) {
            f->eye[e][k] = (float)(5 * c[k]);
            f->axis[e][k] = (float)axis[k];
        }
    }
}

/* Lashes get coordinates of their own: u along the lid, v from the skin
 * (0) to the tip. */
static void face_lay_lashes(struct scan_face *f)
{
    float reach = 0.06f;

    for (size_t i = 0; i < f->nc; i++) {
        int32_t v = f->source[i];
        const float *p = f->neutral + 3 * v;
        float min = 1;
        if (v < FACE_SHADE_END)
            continue;
        for (size_t k = 0; k < FACE_SKIN_END; k++) {
            const float *q = f->neutral + 3 * k;
            float d[3];
            if (fabsf(q[0] - p[0]) > reach || fabsf(q[1] - p[1]) > reach)
                continue;
            sub3(d, q, p);
            min = minf(min, dot3(d, d));
        }
        f->uv[2 * i] = (p[0] - f->eye[p[0] < 0][0]) / 0.16f + 0.5f;
        f->uv[2 * i + 1] = sqrtf(min) / 0.045f;
    }
}

/* The neutral face, identities and expressions, in the head's own frame. */
static int face_load_shapes(struct scan_face *f, const struct safetensors *st,
                            struct error *err)
{
    size_t dims[2] = {FACE_VERTICES, 3}, n;
    static const double shift[3] = {SCAN_SHIFT_X, SCAN_SHIFT_Y, SCAN_SHIFT_Z};

    f->neutral = st_load_f32(st, "neutral", 2, dims, &n, err);
    if (!f->neutral || face_load_identities(f, st, err)
        || face_load_expressions(f, st, err))
        return -1;
    for (size_t i = 0; i < n; i++)
        f->neutral[i] = FACE_UNIT * f->neutral[i] + (float)(5 * shift[i % 3]);
    scan_face_find_eyes(f);
    size_t one = 3 * (size_t)FACE_VERTICES;
    return scan_lids_init(&f->lids, f->neutral,
                          f->expression + ARKIT_EYE_BLINK_L * one,
                          f->expression + ARKIT_EYE_BLINK_R * one, 5, err);
}

/* ---- whole -------------------------------------------------------------- */

/* Vertices of the 68 landmarks. */
static int face_load_landmarks(struct scan_face *f, const char *dir,
                               struct error *err)
{
    char path[4096];
    int rc;

    snprintf(path, sizeof path, "%s/vertex_indices.json", dir);
    cJSON *j = scan_json_read(path, err);
    if (!j)
        return -1;
    rc = scan_json_ints(f->landmark, FACE_LANDMARKS, FACE_VERTICES, j,
                        "idx_to_landmark_verts", err);
    cJSON_Delete(j);
    return rc ? error_prefix(err, "%s", path) : 0;
}

int scan_face_load(struct scan_face *f, const char *dir, struct error *err)
{
    char path[4096];
    struct quads q = {0};
    int rc;

    *f = (struct scan_face){0};
    snprintf(path, sizeof path, "%s/ict.safetensors", dir);
    struct safetensors *st = st_open(path, err);
    if (!st)
        return -1;
    rc = face_load_shapes(f, st, err) || face_quads_load(&q, st, err)
         || face_make_faces(f, &q, err);
    if (!rc)
        face_lay_lashes(f);
    face_quads_release(&q);
    if (rc)
        error_prefix(err, "%s", path);
    else
        rc = face_load_landmarks(f, dir, err);
    st_close(st);
    if (rc)
        scan_face_release(f);
    return rc ? -1 : 0;
}

void scan_face_release(struct scan_face *f)
{
    scan_lids_release(&f->lids);
    free(f->source);
    free(f->uv);
    free(f->faces);
    free(f->raw);
    free(f->part);
    free(f->neutral);
    free(f->identity);
    free(f->expression);
    free(f->dilate);
    *f = (struct scan_face){0};
}

void scan_face_fold(float *out, const struct scan_face *f, const float *beta,
                    size_t n)
{
    size_t one = 3 * (size_t)FACE_VERTICES;

    memcpy(out, f->neutral, one * sizeof *out);
    for (size_t k = 0; k < n && k < SCAN_IDENTITIES; k++) {
        const float *d = f->identity + k * one, w = beta[k];
        for (size_t i = 0; w != 0 && i < one; i++)
            out[i] += w * d[i];
    }
}

void scan_face_express(float *x, const struct scan_face *f, const float *rest,
                       const float *w)
{
    size_t one = 3 * (size_t)FACE_VERTICES;

    for (int k = 0; k < ARKIT_COUNT; k++) {
        const float *d = f->expression + (size_t)k * one;
        if (fabsf(w[k]) < 1e-6f)
            continue;
        for (size_t i = 0; i < one; i++)
            x[i] += w[k] * d[i];
    }
    scan_lids_add(x, &f->lids, rest, w[ARKIT_EYE_BLINK_L],
                  w[ARKIT_EYE_BLINK_R]);
}

void scan_face_normals(float *n, const float *x, const struct scan_face *f)
{
    memset(n, 0, 3 * FACE_VERTICES * sizeof *n);
    for (size_t i = 0; i < f->nf; i++) {
        const int32_t *v = f->raw + 3 * i;
        const float *a = x + 3 * v[0];
        float e[3], g[3], c[3];
        sub3(e, x + 3 * v[1], a);
        sub3(g, x + 3 * v[2], a);
        cross3(c, e, g);
        for (int k = 0; k < 3; k++)
            mad3(n + 3 * v[k], n + 3 * v[k], c, 1);
    }
    for (size_t i = 0; i < FACE_VERTICES; i++)
        unit3(n + 3 * i);
}
