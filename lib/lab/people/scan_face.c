/* ICT-FaceKit's whole mesh read, and split where texture coordinates part. */
#include "lib/lab/people/scan_face.h"

#include <math.h>
#include <string.h>
#include <sysexits.h>

#include "formats/safetensors.h"
#include "lib/head/arkit.h"
#include "lib/base/vec3.h"

/* ---- faces -------------------------------------------------------------- */

struct quads {
    const int32_t *v;           /* (SCAN_QUADS,4) */
    int32_t *t, *part;          /* (SCAN_QUADS,4), (SCAN_QUADS) */
    float *uv;                  /* (nuv,2) */
    size_t nuv;
};

/* Their texture places and parts, all within range. */
static int face_quads_load(struct quads *q, const struct safetensors *st,
                           struct arena *room, struct error *err)
{
    const size_t four[2] = {SCAN_QUADS, 4}, pairs[2] = {0, 2};

    q->t = arena_keep(room, st_load_i32(st, "quads_uv", 2, four, NULL, err), err);
    if (!q->t)
        return -1;
    q->part = arena_keep(room, st_load_i32(st, "material", 1, four, NULL, err), err);
    if (!q->part)
        return -1;
    q->uv = arena_keep(room, st_load_f32(st, "uv", 2, pairs, &q->nuv, err), err);
    if (!q->uv)
        return -1;
    q->nuv /= 2;
    for (size_t i = 0; i < 4 * SCAN_QUADS; i++)
        if (q->t[i] < 0 || (size_t)q->t[i] >= q->nuv)
            return error_set(err, EX_DATAERR, "quads_uv: %zu is %d (expected "
                             "0 to %zu)", i / 4, q->t[i], q->nuv - 1);
    for (size_t i = 0; i < SCAN_QUADS; i++)
        if (q->part[i] < 0 || q->part[i] >= PART_COUNT)
            return error_set(err, EX_DATAERR, "material: %zu is %d (expected "
                             "0 to %d)", i, q->part[i], PART_COUNT - 1);
    return 0;
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
                           struct arena *memory, struct arena *room,
                           struct error *err)
{
    int32_t *of_uv = arena_take(room, q->nuv, sizeof *of_uv);

    f->source = arena_take(memory, 4 * SCAN_QUADS, sizeof *f->source);
    f->uv = arena_take(memory, 8 * SCAN_QUADS, sizeof *f->uv);
    f->faces = arena_take(memory, 6 * SCAN_QUADS, sizeof *f->faces);
    f->raw = arena_take(memory, 6 * SCAN_QUADS, sizeof *f->raw);
    f->part = arena_take(memory, 2 * SCAN_QUADS, 1);
    if (arena_check(memory, "the scans", err) ||
        arena_check(room, "the scans", err))
        return -1;
    for (size_t i = 0; i < q->nuv; i++)
        of_uv[i] = -1;
    for (size_t i = 0; i < SCAN_QUADS; i++) {
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
    return 0;
}

/* ---- the whole ---------------------------------------------------------- */

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

/* The scans' centimetres to head units. */
static int face_take_shapes(struct scan_face *f, const struct scan *s,
                            struct arena *memory, struct error *err)
{
    const size_t one = 3 * (size_t)FACE_VERTICES;
    static const double shift[3] = {SCAN_SHIFT_X, SCAN_SHIFT_Y, SCAN_SHIFT_Z};

    f->neutral = arena_take(memory, one, sizeof *f->neutral);
    f->identity = arena_take(memory, SCAN_IDENTITIES * one,
                             sizeof *f->identity);
    f->expression = arena_take(memory, ARKIT_COUNT * one,
                               sizeof *f->expression);
    if (arena_check(memory, "the scans", err))
        return -1;
    for (size_t i = 0; i < one; i++)
        f->neutral[i] = FACE_UNIT * s->neutral[i] + (float)(5 * shift[i % 3]);
    for (size_t i = 0; i < SCAN_IDENTITIES * one; i++)
        f->identity[i] = FACE_UNIT * s->identity[i];
    for (size_t i = 0; i < ARKIT_COUNT * one; i++)
        f->expression[i] = FACE_UNIT * s->expression[i];
    scan_face_find_eyes(f);
    return scan_lids_init(&f->lids, f->neutral,
                          f->expression + ARKIT_EYE_BLINK_L * one,
                          f->expression + ARKIT_EYE_BLINK_R * one, 5, memory,
                          err);
}

int scan_face_load(struct scan_face *f, const char *path, struct arena *memory,
                   struct error *err)
{
    struct safetensors *st = st_open(path, err);
    struct scan s;

    *f = (struct scan_face){0};
    if (!st || scan_read(&s, st, err)) {
        st_close(st);
        return -1;
    }
    struct quads q = {.v = s.quads};
    int rc = face_quads_load(&q, st, &s.memory, err) ||
             face_take_shapes(f, &s, memory, err) ||
             face_make_faces(f, &q, memory, &s.memory, err)
             ? error_prefix(err, "%s", path) : 0;

    if (rc == 0)
        face_lay_lashes(f);
    memcpy(f->landmark, scan_landmarks, sizeof f->landmark);
    scan_release(&s);
    st_close(st);
    return rc;
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
