/* ICT-FaceKit's files read, checked and moved into our world. */
#include "lib/lab/head/scan.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/safetensors.h"
#include "lib/head/arkit.h"

/* The 68 points' vertices, as ICT-FaceKit lists them. */
const int32_t scan_landmarks[SCAN_LANDMARKS] = {
    1225, 1888, 1052, 367, 1719, 1722, 2199, 1447, 966, 3661, 4390, 3927,
    3924, 2608, 3272, 4088, 3443, 268, 493, 1914, 2044, 1401, 3615, 4240,
    4114, 2734, 2509, 978, 4527, 4942, 4857, 1140, 2075, 1147, 4269, 3360,
    1507, 1542, 1537, 1528, 1518, 1511, 3742, 3751, 3756, 3721, 3725, 3732,
    5708, 5695, 2081, 0, 4275, 6200, 6213, 6346, 6461, 5518, 5957, 5841,
    5702, 5711, 5533, 6216, 6207, 6470, 5517, 5966
};

/* The scans' sclera about the cornea, as a sphere: fitted to the vertices of
 * the left ball in front of z = 83 mm and 7 to 14.5 mm off its axis, which err
 * by 0.4 mm at most; the axis runs through the cornea's apex.  Centimetres of
 * the file; left, the right one mirrors it. */
static const double eye_centre[3] = { 3.14497, 3.61090, 8.00981 };
static const double eye_apex[3] = { 3.23750, 3.61090, 9.64757 };

void scan_eye(double centre[3], int right)
{
    static const double shift[3] = {SCAN_SHIFT_X, SCAN_SHIFT_Y, SCAN_SHIFT_Z};

    for (int c = 0; c < 3; c++)
        centre[c] = SCAN_SCALE * eye_centre[c] + shift[c];
    centre[0] *= right ? -1 : 1;
}

void scan_eye_axis(double axis[3], int right)
{
    double l = 0;

    for (int c = 0; c < 3; c++) {
        axis[c] = eye_apex[c] - eye_centre[c];
        l += axis[c] * axis[c];
    }
    for (int c = 0; c < 3; c++)
        axis[c] /= sqrt(l);
    axis[0] *= right ? -1 : 1;
}

void scan_eye_motion(double shift[3], double *grow, const float *neutral,
                     const float *face, double unit, int right)
{
    const size_t n = SCAN_IRIS_LEFT - SCAN_EYE_LEFT;
    const size_t first = 3 * (size_t)(right ? SCAN_EYE_RIGHT : SCAN_EYE_LEFT);
    const float *p = neutral + first, *q = face + first;
    double mean[3] = {0}, pd = 0, pp = 0, eye[3];

    shift[0] = shift[1] = shift[2] = 0;
    for (size_t i = 0; i < 3 * n; i++) {
        mean[i % 3] += p[i] / (double)n;
        shift[i % 3] += (q[i] - p[i]) / (double)n;
    }
    for (size_t i = 0; i < 3 * n; i++) {
        double x = p[i] - mean[i % 3];

        pd += x * (q[i] - p[i] - shift[i % 3]);
        pp += x * x;
    }
    *grow = pd / pp;
    scan_eye(eye, right);
    for (int c = 0; c < 3; c++)     /* from the vertices' mean to the centre */
        shift[c] += *grow * (unit * eye[c] - mean[c]);
}

/* ---- the file ------------------------------------------------------------ */

/* Row of `name` in the metadata's list of expressions, or -1. */
static int scan_expression_row(const cJSON *names, const char *name)
{
    for (int i = 0; i < cJSON_GetArraySize(names); i++) {
        const cJSON *n = cJSON_GetArrayItem(names, i);

        if (cJSON_IsString(n) && !strcmp(n->valuestring, name))
            return i;
    }
    return -1;
}

/* Our 53 of the file's 57 expressions, in our order: to from all. */
static int scan_choose_expressions(float *to, const float *all,
                                   const cJSON *names, struct error *err)
{
    const size_t row = 3 * (size_t)SCAN_VERTS;

    if (!cJSON_IsArray(names))
        return error_set(err, EX_DATAERR, "metadata \"expression_names\" is "
                         "missing (expected a list of names)");
    for (int k = 0; k < ARKIT_COUNT; k++) {
        int from = scan_expression_row(names, arkit_name(k));

        if (from < 0 || from >= SCAN_EXPRESSIONS)
            return error_set(err, EX_DATAERR, "no expression \"%s\" (expected "
                             "the scans' file)", arkit_name(k));
        memcpy(to + (size_t)k * row, all + (size_t)from * row,
               row * sizeof *all);
    }
    return 0;
}

static int scan_check_quads(const int32_t *quads, struct error *err)
{
    for (size_t i = 0; i < 4 * SCAN_QUADS; i++)
        if (quads[i] < 0 || quads[i] >= SCAN_VERTS)
            return error_set(err, EX_DATAERR, "quads[%zu] is %d (expected 0 to "
                             "%d)", i / 4, quads[i], SCAN_VERTS - 1);
    return 0;
}

int scan_read(struct scan *s, const struct safetensors *st, struct error *err)
{
    const size_t dims[3] = {SCAN_IDENTITIES, SCAN_VERTS, 3};
    const size_t acts[3] = {SCAN_EXPRESSIONS, SCAN_VERTS, 3};
    const size_t quads[2] = {SCAN_QUADS, 4};
    const char *text = st_meta(st, "expression_names");
    cJSON *names = text ? cJSON_Parse(text) : NULL;
    float *all = NULL;
    int rc = -1;

    *s = (struct scan){.nf = 0};
    struct arena *a = &s->memory;

    s->neutral = arena_keep(a, st_load_f32(st, "neutral", 2, dims + 1, NULL,
                                           err), err);
    if (s->neutral)
        s->identity = arena_keep(a, st_load_f32(st, "identity", 3, dims, NULL,
                                                err), err);
    if (s->identity)
        s->quads = arena_keep(a, st_load_i32(st, "quads", 2, quads, NULL, err),
                              err);
    if (s->quads)
        all = st_load_f32(st, "expression", 3, acts, NULL, err);
    s->expression = arena_take(a, ARKIT_COUNT * 3 * (size_t)SCAN_VERTS,
                               sizeof *s->expression);
    if (all && arena_check(a, "the scans", err) == 0)
        rc = scan_check_quads(s->quads, err) ||
             scan_choose_expressions(s->expression, all, names, err)
             ? error_prefix(err, "%s", st_path(st)) : 0;
    free(all);
    cJSON_Delete(names);
    if (rc)
        scan_release(s);
    return rc;
}

/* The scans' centimetres to our frame; shapes are differences and only
 * scale. */
static void scan_to_metres(struct scan *s)
{
    static const double shift[3] = {SCAN_SHIFT_X, SCAN_SHIFT_Y, SCAN_SHIFT_Z};
    const size_t row = 3 * (size_t)SCAN_VERTS;

    for (size_t i = 0; i < row; i++)
        s->neutral[i] = (float)(SCAN_SCALE * s->neutral[i] + shift[i % 3]);
    for (size_t i = 0; i < SCAN_IDENTITIES * row; i++)
        s->identity[i] *= (float)SCAN_SCALE;
    for (size_t i = 0; i < ARKIT_COUNT * row; i++)
        s->expression[i] *= (float)SCAN_SCALE;
}

static bool scan_is_skin(const int32_t *q)
{
    return q[0] < SCAN_SKIN && q[1] < SCAN_SKIN && q[2] < SCAN_SKIN &&
           q[3] < SCAN_SKIN;
}

/* The skin's quads, each as two triangles. */
static int scan_make_triangles(struct scan *s, struct error *err)
{
    s->f = arena_take(&s->memory, 6 * SCAN_QUADS, sizeof *s->f);
    if (arena_check(&s->memory, "the scans' faces", err))
        return -1;
    for (size_t i = 0; i < SCAN_QUADS; i++) {
        const int32_t *q = s->quads + 4 * i;

        for (int t = 0; scan_is_skin(q) && t < 2; t++) {
            int32_t *f = s->f + 3 * s->nf;

            f[0] = q[0], f[1] = q[1 + t], f[2] = q[2 + t];
            s->nf += f[1] != f[2];
        }
    }
    return 0;
}

int scan_load(struct scan *s, const char *path, struct error *err)
{
    struct safetensors *st = st_open(path, err);
    int rc = st ? scan_read(s, st, err) : -1;

    st_close(st);
    if (rc)
        return -1;
    scan_to_metres(s);
    if (scan_make_triangles(s, err)) {
        scan_release(s);
        return error_prefix(err, "%s", path);
    }
    return 0;
}

void scan_release(struct scan *s)
{
    arena_release(&s->memory);
    *s = (struct scan){.nf = 0};
}
