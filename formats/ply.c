/* Gaussian scenes as PLY files, read with any order of properties, written in
 * the usual one, and looked over for what viewers trip over. */
#include "formats/ply.h"

#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/outfile.h"
#include "formats/ply_parts.h"
#include "formats/ply_table.h"

/* ---- writing ------------------------------------------------------------ */

static const char *const field_name[FIELDS] = {
    "x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity",
    "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"};

int ply_check_field(const float row[FIELDS], const char *path, size_t i,
                    struct error *err)
{
    for (int k = 0; k < FIELDS; k++)
        if (!isfinite(row[k]))
            return error_set(err, EX_DATAERR, "%s: %s is not finite at index "
                             "%zu", path, field_name[k], i);
    return 0;
}

/* The properties of FIELDS, all floats. */
static void ply_write_header(FILE *f, size_t n)
{
    fprintf(f, "ply\nformat binary_little_endian 1.0\n"
            "comment SpiD toolkit: coarse colours, degree 0\n"
            "element vertex %zu\n", n);
    for (int i = 0; i < FIELDS; i++)
        fprintf(f, "property float %s\n", field_name[i]);
    fputs("end_header\n", f);
}

/* Unit length, w >= 0; the zero quaternion turns nothing. */
static void ply_quat_canonical(float q[4])
{
    double n = sqrt((double)q[0] * q[0] + (double)q[1] * q[1] +
                    (double)q[2] * q[2] + (double)q[3] * q[3]);

    if (n < 1e-12) {
        q[0] = 1;
        q[1] = q[2] = q[3] = 0;
        return;
    }
    double s = q[0] < 0 ? -1 / n : 1 / n;
    for (int k = 0; k < 4; k++)
        q[k] = (float)(q[k] * s);
}

void ply_row_pack(float out[FIELDS], const struct gaussians *g, size_t i,
                  bool turn)
{
    const float *m = g->mean + 3 * i, *q = g->quat + 4 * i;
    float flip = turn ? -1 : 1;
    double o = fmin(fmax(g->opacity[i], 1e-6), 1 - 1e-6);

    out[0] = flip * m[0];
    out[1] = flip * m[1];
    out[2] = m[2];
    out[3] = out[4] = out[5] = 0;
    for (size_t k = 0; k < 3; k++) {
        out[6 + k] = (float)((gaussians_channel(g, i, k) - 0.5) / GAUSSIAN_SH0);
        out[10 + k] = (float)log(fmax(g->scale[3 * i + k], 1e-7));
    }
    out[9] = (float)log(o / (1 - o));
    out[13] = turn ? -q[3] : q[0];
    out[14] = turn ? -q[2] : q[1];
    out[15] = turn ? q[1] : q[2];
    out[16] = turn ? q[0] : q[3];
    ply_quat_canonical(out + 13);
}

int ply_write(const char *path, const struct gaussians *g, bool turn,
              struct error *err)
{
    struct outfile out;

    if (outfile_open(&out, path, err))
        return -1;
    ply_write_header(out.file, g->n);
    for (size_t i = 0; i < g->n; i++) {
        float row[FIELDS];

        ply_row_pack(row, g, i, turn);
        if (ply_check_field(row, path, i, err)) {
            outfile_abandon(&out);
            return -1;
        }
        fwrite(row, sizeof row, 1, out.file);
    }
    return outfile_close(&out, err);
}

/* ---- reading the scene -------------------------------------------------- */

/* Where in a row the 14 fields stand that a Gaussian must have, normals left
 * out, and f_rest; -1: nowhere. */
struct layout {
    int field[FIELDS], rest[PLY_REST];
    int nrest;
};

/* The place of a property in its element's rows; -1: there is none. */
static int ply_column(const struct ply_element *e, const char *name)
{
    const struct ply_property *p = ply_element_find(e, name);

    return p ? (int)(p - e->property) : -1;
}

int ply_find_rest(int rest[PLY_REST], const struct ply_table *t,
                  const struct ply_element *e, struct error *err)
{
    int n = 0;

    for (; n < PLY_REST; n++) {
        char name[20];

        snprintf(name, sizeof name, "f_rest_%d", n);
        if ((rest[n] = ply_column(e, name)) < 0)
            break;
    }
    if (n && n != 9 && n != 24 && n != 45)
        return ply_table_fail(t, err, "%d properties f_rest_ (expected 0, 9, "
                              "24 or 45)", n);
    return n;
}

/* Which properties are the ones a scene needs. */
static int ply_find_layout(struct layout *l, const struct ply_table *t,
                           const struct ply_element *e, struct error *err)
{
    memset(l, 0, sizeof *l);
    for (int i = 0; i < FIELDS; i++) {
        l->field[i] = ply_column(e, field_name[i]);
        if (l->field[i] < 0 && (i < 3 || i > 5))
            return ply_table_fail(t, err, "no property %s (is this a mesh or "
                                  "a point cloud?)", field_name[i]);
    }
    l->nrest = ply_find_rest(l->rest, t, e, err);
    return l->nrest < 0 ? -1 : 0;
}

void ply_scene_set(struct splats *s, size_t i, const double v[FIELDS])
{
    float *q = s->quat + 4 * i;
    float flip = s->rotated ? -1 : 1;

    s->mean[3 * i] = flip * (float)v[0];
    s->mean[3 * i + 1] = flip * (float)v[1];
    s->mean[3 * i + 2] = (float)v[2];
    for (size_t k = 0; k < 3; k++) {
        s->scale[3 * i + k] = (float)exp(v[10 + k]);
        s->color[3 * i + k] = (float)(0.5 + GAUSSIAN_SH0 * v[6 + k]);
    }
    s->opacity[i] = (float)(1 / (1 + exp(-v[9])));
    for (int k = 0; k < 4; k++)
        q[k] = (float)v[13 + k];
    if (s->rotated) {            /* the turn is its own inverse */
        const float t[4] = {-q[3], -q[2], q[1], q[0]};

        memcpy(q, t, sizeof t);
    }
    ply_quat_canonical(q);
}

int ply_scene_check(const struct splats *s, size_t i, int nrest,
                    const char *path, struct error *err)
{
    bool ok = isfinite(s->opacity[i]);

    for (size_t k = 0; k < 3; k++)
        ok &= isfinite(s->mean[3 * i + k]) && isfinite(s->scale[3 * i + k]) &&
              isfinite(s->color[3 * i + k]);
    for (size_t k = 0; k < 4; k++)
        ok &= isfinite(s->quat[4 * i + k]);
    for (size_t k = 0; k < (size_t)nrest; k++)
        ok &= isfinite(s->rest[(size_t)nrest * i + k]);
    return ok ? 0 : error_set(err, EX_DATAERR, "%s: vertex %zu is not finite",
                              path, i);
}

/* Rows of numbers as they are, each checked. */
static int ply_read_rows(struct splats *s, struct ply_table *t,
                         const struct ply_element *e, struct error *err)
{
    double row[PLY_PROPERTIES], v[FIELDS];
    struct layout l;

    if (ply_find_layout(&l, t, e, err) || ply_table_skip_to(t, e, err)
        || splats_allocate(s, e->n, l.nrest, t->path, err))
        return -1;
    for (size_t i = 0; i < e->n; i++) {
        if (ply_table_row(row, t, e, i, err))
            return -1;
        for (int k = 0; k < FIELDS; k++)
            v[k] = l.field[k] < 0 ? 0 : row[l.field[k]];
        ply_scene_set(s, i, v);
        for (int k = 0; k < l.nrest; k++)
            s->rest[(size_t)l.nrest * i + (size_t)k] = (float)row[l.rest[k]];
        if (ply_scene_check(s, i, l.nrest, t->path, err))
            return -1;
    }
    return 0;
}

/* A file with vertices; NULL and *err. */
static struct ply_table *ply_open(const struct ply_element **vertex,
                                  const char *path, struct error *err)
{
    struct ply_table *t = ply_table_open(path, err);

    *vertex = t ? ply_table_find(t, "vertex") : NULL;
    if (t && !*vertex) {
        ply_table_fail(t, err, "no vertex element");
        ply_table_close(t);
        return NULL;
    }
    return t;
}

int ply_read(struct splats *s, const char *path, bool turn,
             struct error *err)
{
    const struct ply_element *vertex;
    struct ply_table *t = ply_open(&vertex, path, err);
    int rc;

    memset(s, 0, sizeof *s);
    if (!t)
        return -1;
    s->rotated = turn;
    rc = ply_is_packed(t) ? ply_read_packed(s, t, err)
                          : ply_read_rows(s, t, vertex, err);
    ply_table_close(t);
    if (rc)
        splats_release(s);
    return rc;
}

/* ---- lint --------------------------------------------------------------- */

struct lint {
    void (*say)(void *context, const char *text);
    void *context;
    int found;
};

static void ply_lint_report(struct lint *l, size_t count, const char *format,
                            ...)
    __attribute__((format(printf, 3, 4)));

/* A line when count is not 0. */
static void ply_lint_report(struct lint *l, size_t count, const char *format,
                            ...)
{
    char text[300];
    va_list args;

    if (!count)
        return;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    l->say(l->context, text);
    l->found++;
}

/* Form, order, types and names of the properties. */
static void ply_lint_layout(struct lint *l, const struct ply_table *t,
                            const struct ply_element *h)
{
    size_t at = 0, order = 0, types = 0, extra = 0;

    ply_lint_report(l, t->form != PLY_LITTLE, "%s numbers: several viewers "
                    "read binary_little_endian only", t->form == PLY_ASCII
                    ? "ascii" : "big-endian");
    for (size_t i = 0; i < h->count; i++) {
        const struct ply_property *p = &h->property[i];
        size_t k = 0;

        while (k < FIELDS && strcmp(p->name, field_name[k]))
            k++;
        bool rest = !strncmp(p->name, "f_rest_", 7);
        types += p->type != PLY_F32;
        extra += k == FIELDS && !rest;
        if (k < FIELDS) {
            order += k < at;
            at = k;
        }
    }
    ply_lint_report(l, types, "%zu properties are not float: several viewers "
                    "read float32 only", types);
    ply_lint_report(l, order,
                    "properties are not in the usual order: viewers that read "
                    "by position will show noise");
    ply_lint_report(l, extra,
                    "%zu extra properties: viewers that read by position will "
                    "show noise",
                    extra);
    ply_lint_report(l, !ply_element_find(h, "nx"),
                    "no normals: viewers that read by position expect "
                    "nx ny nz");
    ply_lint_report(l, h->n == 0, "no Gaussians");
}

/* Counts what one row has wrong. */
struct lint_rows {
    size_t not_unit, infinite, opacity, scale;
};

static void ply_lint_row(struct lint_rows *c, const double *row,
                         const struct layout *y)
{
    bool finite = true;
    double q = 0;

    for (int k = 0; k < FIELDS; k++)
        finite &= y->field[k] < 0 || isfinite(row[y->field[k]]);
    for (int k = 13; k < 17; k++)
        q += pow(row[y->field[k]], 2);
    c->infinite += !finite;
    c->not_unit += !(fabs(q - 1) < 1e-3);
    c->opacity += row[y->field[9]] >= 0 && row[y->field[9]] <= 1;
    c->scale += row[y->field[10]] > 0;
}

/* The rows of a file that is not packed. */
static int ply_lint_rows(struct lint *l, struct ply_table *t,
                         const struct ply_element *h, struct error *err)
{
    double row[PLY_PROPERTIES];
    struct lint_rows c = {0};
    struct layout y;

    if (ply_find_layout(&y, t, h, err) || ply_table_skip_to(t, h, err))
        return -1;
    ply_lint_layout(l, t, h);
    for (size_t i = 0; i < h->n; i++) {
        if (ply_table_row(row, t, h, i, err))
            return -1;
        ply_lint_row(&c, row, &y);
    }
    ply_lint_report(l, c.infinite, "%zu Gaussians have values that are not "
                    "finite: viewers show nothing or crash", c.infinite);
    ply_lint_report(l, c.not_unit, "%zu rotations are not unit quaternions: "
                    "some viewers do not normalise them", c.not_unit);
    ply_lint_report(l, h->n && c.opacity == h->n,
                    "every opacity lies in 0..1: are they linear? the layout "
                    "wants logits");
    ply_lint_report(l, h->n && c.scale == h->n, "every scale is positive: are "
                    "they linear? the layout wants logarithms");
    return 0;
}

int ply_lint(const char *path, void (*say)(void *context, const char *text),
             void *context, struct error *err)
{
    struct lint l = {say, context, 0};
    const struct ply_element *vertex;
    struct ply_table *t = ply_open(&vertex, path, err);
    struct splats s;
    int rc = t ? 0 : -1;

    if (t && !ply_is_packed(t)) {
        rc = ply_lint_rows(&l, t, vertex, err);
    } else if (t) {             /* its ranges hold nothing but such values */
        rc = ply_read(&s, path, true, err);
        if (rc == 0)
            ply_lint_report(&l, s.n == 0, "no Gaussians");
        splats_release(&s);
    }
    ply_table_close(t);
    return rc ? -1 : l.found;
}
