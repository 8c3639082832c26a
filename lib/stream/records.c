/* Records as structs, by the table of records (schema.h), and what of each goes
 * together. */
#include "lib/stream/records.h"

#include <string.h>
#include <sysexits.h>

#include "lib/stream/schema.h"

/* Rows of such tables: the array is named as the member. */
#define F32(type, member) {#member, offsetof(struct type, member), DTYPE_F32}
#define I32(type, member) {#member, offsetof(struct type, member), DTYPE_I32}
#define U8(type, member) {#member, offsetof(struct type, member), DTYPE_U8}
#define COUNT(fields) ((int)(sizeof fields / sizeof *fields))

/* ---- CONF --------------------------------------------------------------- */

int conf_text_write(struct stream_writer *w, const char *json,
                    struct error *err)
{
    const struct array a = array_make("json", DTYPE_U8, json, 1, strlen(json),
                                      0, 0, 0);

    return stream_write(w, RECORD_CONF, 0, 0, &a, 1, err);
}

const char *conf_text(size_t *bytes, const struct record *rec)
{
    const struct array *a = record_find(rec, "json");

    *bytes = a && a->dtype == DTYPE_U8 ? array_bytes(a) : 0;
    return *bytes ? a->data : NULL;
}

/* ---- SHAP --------------------------------------------------------------- */

static const struct schema_field shape_fields[] = {
    {"shape", offsetof(struct shape, beta), DTYPE_F32}, F32(shape, offset),
    I32(shape, person)
};

int shape_read(struct shape *s, const struct record *rec, struct error *err)
{
    memset(s, 0, sizeof *s);
    s->n = schema_rows(rec, "shape");
    s->vertices = schema_rows(rec, "offset");
    return schema_read(s, rec, shape_fields, COUNT(shape_fields), err);
}

int shape_write(struct stream_writer *w, uint64_t frame, double time,
                const struct shape *s, struct error *err)
{
    const size_t size[] = {['*'] = s->n, ['V'] = s->vertices};
    struct array a[COUNT(shape_fields)];

    return stream_write(w, RECORD_SHAP, frame, time, a,
                        schema_arrays(a, RECORD_SHAP, s, shape_fields,
                                      COUNT(shape_fields), size), err);
}

/* ---- IMAG --------------------------------------------------------------- */

static const struct schema_field imag_fields[] = {
    U8(imag, rgb), U8(imag, alpha), U8(imag, mask), U8(imag, label),
    U8(imag, alone)
};

int imag_read(struct imag *im, const struct record *rec, struct error *err)
{
    memset(im, 0, sizeof *im);
    if (schema_read(im, rec, imag_fields, COUNT(imag_fields), err))
        return -1;
    im->height = record_find(rec, "rgb")->dim[0];
    im->width = record_find(rec, "rgb")->dim[1];
    if (im->width != im->height || !im->mask)
        return error_set(err, EX_DATAERR, "IMAG of %zu x %zu pixels, %s mask "
                         "(expected a square with one)", im->width, im->height,
                         im->mask ? "with a" : "without");
    return 0;
}

size_t imag_size(const struct record *rec)
{
    const struct array *rgb = record_find(rec, "rgb");

    return rgb && rgb->ndim == 3 ? rgb->dim[0] : 0;
}

int imag_write(struct stream_writer *w, uint64_t frame, double time,
               const struct imag *im, struct error *err)
{
    const size_t size[] = {['H'] = im->height, ['W'] = im->width};
    struct array a[COUNT(imag_fields)];

    return stream_write(w, RECORD_IMAG, frame, time, a,
                        schema_arrays(a, RECORD_IMAG, im, imag_fields,
                                      COUNT(imag_fields), size), err);
}

/* ---- GAUS --------------------------------------------------------------- */

static const struct schema_field gaus_fields[] = {
    F32(gaus, mean), F32(gaus, scale), F32(gaus, quat), F32(gaus, opacity),
    F32(gaus, color), {"color", offsetof(struct gaus, color_half), DTYPE_F16},
    U8(gaus, branch), F32(gaus, lip), F32(gaus, jaw), F32(gaus, chin),
    I32(gaus, vertex), F32(gaus, bend), F32(gaus, pivot), F32(gaus, source),
    F32(gaus, light), F32(gaus, lamp), F32(gaus, uv), F32(gaus, seen),
    F32(gaus, view), F32(gaus, reach), F32(gaus, normal), F32(gaus, tilt),
    F32(gaus, around), U8(gaus, grain), F32(gaus, cam)
};

int gaus_read(struct gaus *g, const struct record *rec, struct error *err)
{
    memset(g, 0, sizeof *g);
    if (schema_read(g, rec, gaus_fields, COUNT(gaus_fields), err))
        return -1;
    g->n = schema_rows(rec, "mean");
    g->channels = record_find(rec, "color")->dim[1];
    g->vertices = schema_rows(rec, "vertex");
    g->jaws = schema_rows(rec, "jaw");
    g->grain_size = schema_rows(rec, "grain");
    if (g->channels == 0)
        return error_set(err, EX_DATAERR, "GAUS color has no channels "
                         "(expected at least one)");
    if (!g->jaw != !g->chin)
        return error_set(err, EX_DATAERR, "GAUS has %s without %s",
                         g->jaw ? "jaw" : "chin", g->jaw ? "chin" : "jaw");
    if (!g->uv != !g->seen || !g->uv != !g->view)
        return error_set(err, EX_DATAERR, "GAUS has %s without %s",
                         g->uv ? "uv" : g->seen ? "seen" : "view",
                         !g->uv ? "uv" : g->seen ? "view" : "seen");
    if (!g->around != !g->grain)
        return error_set(err, EX_DATAERR, "GAUS has %s without %s",
                         g->grain ? "grain" : "around",
                         g->grain ? "around" : "grain");
    return 0;
}

int gaus_arrays(struct array a[STREAM_MAX_ARRAYS], const struct gaus *g)
{
    const size_t size[] = {['N'] = g->n, ['C'] = g->channels,
                           ['M'] = g->vertices, ['K'] = g->jaws,
                           ['G'] = g->grain_size};

    return schema_arrays(a, RECORD_GAUS, g, gaus_fields, COUNT(gaus_fields),
                         size);
}

int gaus_write(struct stream_writer *w, uint64_t frame, double time,
               const struct gaus *g, struct error *err)
{
    struct array a[STREAM_MAX_ARRAYS];

    return stream_write(w, RECORD_GAUS, frame, time, a, gaus_arrays(a, g),
                        err);
}

/* ---- GMOV --------------------------------------------------------------- */

static const struct schema_field gmov_fields[] = {
    F32(gmov, cam), I32(gmov, first), F32(gmov, mean), F32(gmov, shift),
    F32(gmov, chin), F32(gmov, body)
};

int gmov_read(struct gmov *m, const struct record *rec, struct error *err)
{
    memset(m, 0, sizeof *m);
    if (schema_read(m, rec, gmov_fields, COUNT(gmov_fields), err))
        return -1;
    m->count = schema_rows(rec, "mean");
    if (!m->mean != !m->first)
        return error_set(err, EX_DATAERR, "GMOV has %s without %s",
                         m->mean ? "mean" : "first", m->mean ? "first" : "mean");
    return 0;
}

int gmov_arrays(struct array a[STREAM_MAX_ARRAYS], const struct gmov *m)
{
    const size_t size[] = {['M'] = m->count, ['Z'] = 0};

    return schema_arrays(a, RECORD_GMOV, m, gmov_fields, COUNT(gmov_fields),
                         size);
}

/* ---- FEAT --------------------------------------------------------------- */

static const struct schema_field feat_fields[] = {
    {"feat", offsetof(struct feat, f32), DTYPE_F32},
    {"feat", offsetof(struct feat, f16), DTYPE_F16}, F32(feat, alpha),
    F32(feat, depth), F32(feat, photo), F32(feat, place), F32(feat, map),
    U8(feat, grain), F32(feat, gain), F32(feat, tint), F32(feat, turn)
};

/* What goes with what: names of arrays, the second of which the first needs. */
static const char *const needs[][2] = {
    {"photo", "alpha"}, {"tint", "gain"}, {"place", "map"}, {"map", "place"},
    {"place", "alpha"}, {"grain", "place"}
};

/* Packed features are taken as the whole picture they stand for, which must
 * not be larger than a record may be. */
static int feat_check_size(const struct array *feat, const struct array *alpha,
                           struct error *err)
{
    const size_t n = array_count(alpha);
    const size_t bytes = feat->dim[1] * dtype_size(feat->dtype);

    if (n > SIZE_MAX / (bytes + 1) || n * bytes > stream_limit())
        return error_set(err, EX_DATAERR, "FEAT feat of %zu x %zu pixels is "
                         "larger than --max-bytes", alpha->dim[1],
                         alpha->dim[0]);
    return 0;
}

/* The gains are of every FEAT_GAIN pixels. */
static int feat_check_gain(const struct feat *f, struct error *err)
{
    const size_t h = (f->height + FEAT_GAIN - 1) / FEAT_GAIN;
    const size_t w = (f->width + FEAT_GAIN - 1) / FEAT_GAIN;

    if (f->gain && (f->gain_height != h || f->gain_width != w))
        return error_set(err, EX_DATAERR, "FEAT gain is %zu x %zu (expected "
                         "%zu x %zu)", f->gain_height, f->gain_width, h, w);
    return 0;
}

int feat_read(struct feat *f, const struct record *rec, struct error *err)
{
    const struct array *a = record_find(rec, "feat");
    const struct array *alpha = record_find(rec, "alpha");
    const struct array *photo = record_find(rec, "photo");

    memset(f, 0, sizeof *f);
    if (schema_read(f, rec, feat_fields, COUNT(feat_fields), err))
        return -1;
    for (size_t i = 0; i < sizeof needs / sizeof *needs; i++)
        if (record_find(rec, needs[i][0]) && !record_find(rec, needs[i][1]))
            return error_set(err, EX_DATAERR, "FEAT has %s without %s",
                             needs[i][0], needs[i][1]);
    f->packed = a->ndim == 2;
    if (f->packed && !alpha)
        return error_set(err, EX_DATAERR, "FEAT has packed feat without alpha");
    if (photo && photo->ndim != a->ndim)
        return error_set(err, EX_DATAERR, "FEAT has one of feat and photo "
                         "packed (expected both or none)");
    if (f->packed && feat_check_size(a, alpha, err))
        return -1;
    f->height = f->packed ? alpha->dim[0] : a->dim[0];
    f->width = f->packed ? alpha->dim[1] : a->dim[1];
    f->channels = a->dim[a->ndim - 1];
    f->pixels = f->packed ? a->dim[0] : 0;
    f->grain_size = schema_rows(rec, "grain");
    f->gain_height = schema_rows(rec, "gain");
    f->gain_width = f->gain ? record_find(rec, "gain")->dim[1] : 0;
    return feat_check_gain(f, err);
}

int feat_write(struct stream_writer *w, uint64_t frame, double time,
               const struct feat *f, const struct iovec *part, size_t parts,
               struct error *err)
{
    const size_t size[] = {['H'] = f->height, ['W'] = f->width,
                           ['C'] = f->channels, ['Q'] = f->grain_size,
                           ['G'] = f->gain_height, ['K'] = f->gain_width,
                           ['P'] = f->packed ? f->pixels : SCHEMA_NOT};
    struct array a[COUNT(feat_fields)];

    return stream_write_parts(w, RECORD_FEAT, frame, time, a,
                              schema_arrays(a, RECORD_FEAT, f, feat_fields,
                                            COUNT(feat_fields), size),
                              part, parts, err);
}
