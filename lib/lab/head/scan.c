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

/* Our 53 of the file's 57 expressions, in our order. */
static int scan_read_expressions(struct scan *s, const struct safetensors *st,
                                 struct error *err)
{
    const size_t row = 3 * (size_t)SCAN_VERTS;
    size_t dims[3] = {57, SCAN_VERTS, 3};
    const char *text = st_meta(st, "expression_names");
    cJSON *names = text ? cJSON_Parse(text) : NULL;
    float *all = NULL;
    int rc = -1;

    if (!cJSON_IsArray(names)) {
        error_set(err, EX_DATAERR, "%s: metadata \"expression_names\" is "
                  "missing (expected a list of names)", st_path(st));
        goto out;
    }
    all = st_load_f32(st, "expression", 3, dims, NULL, err);
    s->expression = malloc(ARKIT_COUNT * row * sizeof *all);
    if (!all || !s->expression)
        goto out;
    for (int k = 0; k < ARKIT_COUNT; k++) {
        int from = scan_expression_row(names, arkit_name(k));

        if (from < 0 || from >= (int)dims[0]) {
            error_set(err, EX_DATAERR, "%s: no expression \"%s\" (expected "
                      "the scans' file)", st_path(st), arkit_name(k));
            goto out;
        }
        memcpy(s->expression + (size_t)k * row, all + (size_t)from * row,
               row * sizeof *all);
    }
    rc = 0;
out:
    free(all);
    cJSON_Delete(names);
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

/* The skin's quads, each as two triangles. */
static int scan_make_triangles(struct scan *s, struct error *err)
{
    s->f = malloc(6 * (size_t)SCAN_QUADS * sizeof *s->f);
    if (!s->f)
        return error_set(err, EX_OSERR, "no memory for the scans' faces");
    for (size_t i = 0; i < SCAN_QUADS; i++) {
        const int32_t *q = s->quads + 4 * i;
        int skin = 1;

        for (int k = 0; k < 4; k++) {
            if (q[k] < 0 || q[k] >= SCAN_VERTS)
                return error_set(err, EX_DATAERR, "quads[%zu] is %d (expected "
                                 "0 to %d)", i, q[k], SCAN_VERTS - 1);
            skin &= q[k] < SCAN_SKIN;
        }
        if (!skin)
            continue;
        for (int t = 0; t < 2; t++) {
            int32_t *f = s->f + 3 * s->nf;

            f[0] = q[0], f[1] = q[1 + t], f[2] = q[2 + t];
            s->nf += f[1] != f[2];
        }
    }
    return 0;
}

struct place { float y; int32_t v; };

static int scan_by_height(const void *a, const void *b)
{
    const struct place *p = a, *q = b;

    return (p->y > q->y) - (p->y < q->y);
}

/* The neutral face is symmetric to within the file's rounding. */
static int scan_find_mirror(struct scan *s, struct error *err)
{
    const float near = 1e-4f;
    struct place *order = malloc(SCAN_SKIN * sizeof *order);

    s->mirror = malloc(SCAN_SKIN * sizeof *s->mirror);
    if (!order || !s->mirror) {
        free(order);
        return error_set(err, EX_OSERR, "no memory for the scans' mirror");
    }
    for (int32_t v = 0; v < SCAN_SKIN; v++)
        order[v] = (struct place){s->neutral[3 * v + 1], v};
    qsort(order, SCAN_SKIN, sizeof *order, scan_by_height);
    int lost = 0;
    for (int at = 0; at < SCAN_SKIN; at++) {
        const float *p = s->neutral + 3 * order[at].v;
        float min = 3 * near;
        int32_t best = -1;

        for (int way = -1; way <= 1; way += 2)
            for (int i = at + (way < 0 ? 0 : 1); i >= 0 && i < SCAN_SKIN &&
                 fabsf(order[i].y - order[at].y) < near; i += way) {
                const float *q = s->neutral + 3 * order[i].v;
                float d = fabsf(p[0] + q[0]) + fabsf(p[1] - q[1]) +
                          fabsf(p[2] - q[2]);

                if (d < min) {
                    min = d;
                    best = order[i].v;
                }
            }
        s->mirror[order[at].v] = best;
        lost += best < 0;
    }
    free(order);
    return lost ? error_set(err, EX_DATAERR, "%d vertices of the neutral face "
                            "have no mirror image (expected none)", lost) : 0;
}

int scan_load(struct scan *s, const char *path, struct error *err)
{
    size_t dims[3] = {SCAN_IDENTITIES, SCAN_VERTS, 3};
    size_t quads[2] = {SCAN_QUADS, 4};
    int rc = -1;

    memset(s, 0, sizeof *s);
    struct safetensors *st = st_open(path, err);
    if (!st)
        return -1;
    s->neutral = st_load_f32(st, "neutral", 2, dims + 1, NULL, err);
    if (s->neutral)
        s->identity = st_load_f32(st, "identity", 3, dims, NULL, err);
    if (s->identity)
        s->quads = st_load_i32(st, "quads", 2, quads, NULL, err);
    if (s->quads && !scan_read_expressions(s, st, err)) {
        scan_to_metres(s);
        rc = scan_make_triangles(s, err) || scan_find_mirror(s, err) ? -1 : 0;
        if (rc)
            error_prefix(err, "%s", path);
    }
    st_close(st);
    if (rc)
        scan_release(s);
    return rc;
}

void scan_release(struct scan *s)
{
    free(s->neutral);
    free(s->identity);
    free(s->expression);
    free(s->quads);
    free(s->f);
    free(s->mirror);
    memset(s, 0, sizeof *s);
}

/* ---- loops of vertices --------------------------------------------------- */

static bool scan_is_skin(const int32_t *q)
{
    return q[0] < SCAN_SKIN && q[1] < SCAN_SKIN && q[2] < SCAN_SKIN &&
           q[3] < SCAN_SKIN;
}

/* The skin's quad with the edge a to b, *at where a stands in it; NULL when
 * there is none. */
static const int32_t *scan_quad_at(const struct scan *s, int32_t a, int32_t b,
                                   int *at)
{
    for (size_t i = 0; i < SCAN_QUADS; i++) {
        const int32_t *q = s->quads + 4 * i;

        for (int k = 0; k < 4; k++)
            if (q[k] == a && q[(k + 1) % 4] == b && scan_is_skin(q)) {
                *at = k;
                return q;
            }
    }
    return NULL;
}

/* Where the border goes from v: the end of an edge that no face runs back
 * along; -1 when v is not on it. */
static int32_t scan_border_next(const struct scan *s, int32_t v)
{
    for (size_t i = 0; i < SCAN_QUADS; i++) {
        const int32_t *q = s->quads + 4 * i;
        int back;

        for (int k = 0; k < 4; k++)
            if (q[k] == v && scan_is_skin(q) && q[(k + 1) % 4] != v &&
                !scan_quad_at(s, q[(k + 1) % 4], v, &back))
                return q[(k + 1) % 4];
    }
    return -1;
}

size_t scan_border(int32_t *loop, size_t room, const struct scan *s,
                   int32_t first)
{
    size_t n = 0;

    for (int32_t v = first; v >= 0 && n < room && (n == 0 || v != first);
         v = scan_border_next(s, v))
        loop[n++] = v;
    return n > 2 ? n : 0;
}

int scan_next_loop(int32_t *next, const int32_t *loop, size_t n,
                   const struct scan *s)
{
    for (size_t i = 0; i < n; i++) {
        int k = 0;
        const int32_t *q = scan_quad_at(s, loop[i], loop[(i + 1) % n], &k);

        if (!q || (i > 0 && next[i] != q[(k + 3) % 4]))
            return -1;
        next[i] = q[(k + 3) % 4];
        if (i + 1 < n)
            next[i + 1] = q[(k + 2) % 4];
        else if (next[0] != q[(k + 2) % 4])
            return -1;
    }
    return 0;
}
