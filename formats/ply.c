/* Gaussian scenes as PLY files, read with any order of properties, written in
 * the usual one, and looked over for what viewers trip over. */
#include "formats/ply.h"

#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>

#include "formats/outfile.h"
#include "lib/base/half.h"

/* ---- writing ------------------------------------------------------------ */

enum { FIELDS = 17 };

static const char *const field_name[FIELDS] = {
    "x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity",
    "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"};

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

/* Channel k, or the last one where there are fewer. */
static float ply_gaussian_channel(const struct gaussians *g, size_t i, int k)
{
    size_t c = (size_t)g->channels;
    size_t at = c * i + (size_t)(k < g->channels ? k : g->channels - 1);

    return g->color ? g->color[at] : half_to_float(g->color_half[at]);
}

/* One Gaussian as logit opacity, log scale and degree-0 harmonics. */
static void ply_row_pack(float out[FIELDS], const struct gaussians *g, size_t i,
                         bool turn)
{
    const float *m = g->mean + 3 * i, *q = g->quat + 4 * i;
    float flip = turn ? -1 : 1;
    double o = fmin(fmax(g->opacity[i], 1e-6), 1 - 1e-6);

    out[0] = flip * m[0];
    out[1] = flip * m[1];
    out[2] = m[2];
    out[3] = out[4] = out[5] = 0;
    for (int k = 0; k < 3; k++) {
        out[6 + k] = (float)((ply_gaussian_channel(g, i, k) - 0.5) / PLY_SH0);
        out[10 + k] = (float)log(fmax(g->scale[3 * i + (size_t)k], 1e-7));
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
        for (int k = 0; k < FIELDS; k++)
            if (!isfinite(row[k])) {
                outfile_abandon(&out);
                return error_set(err, EX_DATAERR,
                                 "%s: %s is not finite at index %zu", path,
                                 field_name[k], i);
            }
        fwrite(row, sizeof row, 1, out.file);
    }
    return outfile_close(&out, err);
}

/* ---- reading the header ------------------------------------------------- */

enum { MAX_PROPERTIES = 256, MAX_REST = 45, LINE = 256 };

enum number { I8, U8, I16, U16, I32, U32, F32, F64, NUMBERS };

static const struct {
    const char *name, *alias;
    size_t size;
} numbers[NUMBERS] = {
    {"char", "int8", 1}, {"uchar", "uint8", 1}, {"short", "int16", 2},
    {"ushort", "uint16", 2}, {"int", "int32", 4}, {"uint", "uint32", 4},
    {"float", "float32", 4}, {"double", "float64", 8}};

struct property {
    char name[LINE];
    enum number type;
    size_t offset;
};

struct header {
    size_t n, stride, count;
    struct property property[MAX_PROPERTIES];
};

static int ply_bad_file(struct error *err, const char *path, const char *format,
                        ...)
    __attribute__((format(printf, 3, 4)));

/* EX_DATAERR with the path in front. */
static int ply_bad_file(struct error *err, const char *path, const char *format,
                        ...)
{
    char text[300];
    va_list args;

    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    return error_set(err, EX_DATAERR, "%s: %s", path, text);
}

/* One "property TYPE NAME" of the vertices. */
static int ply_add_property(struct header *h, const char *type,
                            const char *name, const char *path,
                            struct error *err)
{
    struct property *p = &h->property[h->count];
    int t = 0;

    while (t < NUMBERS && strcmp(type, numbers[t].name) &&
           strcmp(type, numbers[t].alias))
        t++;
    if (t == NUMBERS || h->count == MAX_PROPERTIES)
        return ply_bad_file(err, path, "property %s of type %s (expected up "
                            "to %d plain numbers)", name, type,
                            MAX_PROPERTIES);
    snprintf(p->name, sizeof p->name, "%s", name);
    p->type = (enum number)t;
    p->offset = h->stride;
    h->stride += numbers[t].size;
    h->count++;
    return 0;
}

/* Any line of the header; seen: the vertices' element was there. */
static int ply_header_line(struct header *h, char *line, bool *in_vertex,
                           bool *seen, const char *path, struct error *err)
{
    char type[LINE], name[LINE];
    unsigned long long n;

    if (!strncmp(line, "comment", 7) || !strncmp(line, "obj_info", 8))
        return 0;
    if (!strncmp(line, "format ", 7))
        return !strcmp(line, "format binary_little_endian 1.0")
                   ? 0
                   : ply_bad_file(err, path, "'%.60s' (expected format "
                                  "binary_little_endian 1.0)", line);
    if (sscanf(line, "element %200s %llu", name, &n) == 2) {
        if (!strcmp(name, "vertex") && !*seen)
            h->n = (size_t)n;
        else if (!*seen)
            return ply_bad_file(err, path, "element %.60s stands before the "
                                "vertices", name);
        *in_vertex = !strcmp(name, "vertex");
        *seen = true;
        return 0;
    }
    if (sscanf(line, "property %200s %200s", type, name) == 2)
        return *in_vertex ? ply_add_property(h, type, name, path, err) : 0;
    return ply_bad_file(err, path, "header line '%.60s' is not understood",
                        line);
}

/* Up to end_header; afterwards the file stands at the first row. */
static int ply_read_header(struct header *h, FILE *f, const char *path,
                           struct error *err)
{
    char line[LINE];
    bool in_vertex = false, seen = false;

    memset(h, 0, sizeof *h);
    if (!fgets(line, sizeof line, f) || strncmp(line, "ply", 3))
        return ply_bad_file(err, path, "not a PLY file");
    while (fgets(line, sizeof line, f)) {
        line[strcspn(line, "\r\n")] = 0;
        if (!strcmp(line, "end_header"))
            return seen ? 0 : ply_bad_file(err, path, "no vertex element");
        if (ply_header_line(h, line, &in_vertex, &seen, path, err))
            return -1;
    }
    return ply_bad_file(err, path, "the header does not end");
}

/* The property of that name, or NULL. */
static const struct property *ply_header_find(const struct header *h,
                                              const char *name)
{
    for (size_t i = 0; i < h->count; i++)
        if (!strcmp(h->property[i].name, name))
            return &h->property[i];
    return NULL;
}

/* A property of a row as a double. */
static double ply_row_number(const char *row, const struct property *p)
{
    union {
        int8_t i8; uint8_t u8; int16_t i16; uint16_t u16; int32_t i32;
        uint32_t u32; float f; double d;
    } v;

    memcpy(&v, row + p->offset, numbers[p->type].size);
    switch (p->type) {
    case I8: return v.i8;
    case U8: return v.u8;
    case I16: return v.i16;
    case U16: return v.u16;
    case I32: return v.i32;
    case U32: return v.u32;
    case F32: return v.f;
    default: return v.d;
    }
}

/* ---- reading the scene -------------------------------------------------- */

/* The 14 fields a Gaussian must have, normals left out, and f_rest. */
struct layout {
    const struct property *field[FIELDS], *rest[MAX_REST];
    int nrest;
};

/* Which properties are the ones a scene needs. */
static int ply_find_layout(struct layout *l, const struct header *h,
                           const char *path, struct error *err)
{
    memset(l, 0, sizeof *l);
    for (int i = 0; i < FIELDS; i++) {
        l->field[i] = ply_header_find(h, field_name[i]);
        if (!l->field[i] && (i < 3 || i > 5))
            return ply_bad_file(err, path,
                                "no property %s (is this a mesh or a point "
                                "cloud?)",
                                field_name[i]);
    }
    for (; l->nrest < MAX_REST; l->nrest++) {
        char name[20];

        snprintf(name, sizeof name, "f_rest_%d", l->nrest);
        if (!(l->rest[l->nrest] = ply_header_find(h, name)))
            break;
    }
    if (l->nrest && l->nrest != 9 && l->nrest != 24 && l->nrest != 45)
        return ply_bad_file(err, path,
                            "%d properties f_rest_ (expected 0, 9, 24 or 45)",
                            l->nrest);
    return 0;
}

/* One block for n Gaussians with nrest higher harmonics. */
static int ply_scene_allocate(struct ply_scene *s, size_t n, int nrest,
                              const char *path, struct error *err)
{
    float *p = malloc((n * (14 + (size_t)nrest) + 1) * sizeof *p);

    if (!p)
        return error_set(err, EX_OSERR, "%s: out of memory for %zu Gaussians",
                         path, n);
    s->n = n;
    s->degree = nrest == 45 ? 3 : nrest == 24 ? 2 : nrest == 9;
    s->mean = p;
    s->scale = p + 3 * n;
    s->quat = p + 6 * n;
    s->opacity = p + 10 * n;
    s->color = p + 11 * n;
    s->rest = nrest ? p + 14 * n : NULL;
    return 0;
}

/* Gaussian i from its row, turned to y up if need be. */
static void ply_row_unpack(struct ply_scene *s, size_t i, const char *row,
                           const struct layout *l)
{
    double v[FIELDS];
    float *q = s->quat + 4 * i;
    float flip = s->turned ? -1 : 1;

    for (int k = 0; k < FIELDS; k++)
        v[k] = l->field[k] ? ply_row_number(row, l->field[k]) : 0;
    s->mean[3 * i] = flip * (float)v[0];
    s->mean[3 * i + 1] = flip * (float)v[1];
    s->mean[3 * i + 2] = (float)v[2];
    for (size_t k = 0; k < 3; k++) {
        s->scale[3 * i + k] = (float)exp(v[10 + k]);
        s->color[3 * i + k] = (float)(0.5 + PLY_SH0 * v[6 + k]);
    }
    s->opacity[i] = (float)(1 / (1 + exp(-v[9])));
    for (int k = 0; k < 4; k++)
        q[k] = (float)v[13 + k];
    if (s->turned) {            /* the turn is its own inverse */
        const float t[4] = {-q[3], -q[2], q[1], q[0]};

        memcpy(q, t, sizeof t);
    }
    ply_quat_canonical(q);
    for (int k = 0; k < l->nrest; k++)
        s->rest[(size_t)l->nrest * i + (size_t)k] =
            (float)ply_row_number(row, l->rest[k]);
}

/* Everything finite, the quaternion not 0. */
static int ply_check_row(const struct ply_scene *s, size_t i, int nrest,
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
    return ok ? 0 : ply_bad_file(err, path, "vertex %zu is not finite", i);
}

/* Row by row, each checked. */
static int ply_read_rows(struct ply_scene *s, FILE *f, const struct header *h,
                         const struct layout *l, const char *path,
                         struct error *err)
{
    char *row = malloc(h->stride + 1);
    int rc = row ? 0 : error_set(err, EX_OSERR, "%s: out of memory", path);

    for (size_t i = 0; !rc && i < h->n; i++) {
        if (fread(row, h->stride, 1, f) != 1) {
            rc = ply_bad_file(err, path, "ends at vertex %zu (expected %zu)", i,
                              h->n);
            break;
        }
        ply_row_unpack(s, i, row, l);
        rc = ply_check_row(s, i, l->nrest, path, err);
    }
    free(row);
    return rc;
}

/* The file behind its header, whose promise of rows its size must keep. */
static FILE *ply_open_scene(struct header *h, struct layout *l,
                            const char *path, struct error *err)
{
    struct stat sb;
    FILE *f = fopen(path, "rb");

    if (!f || fstat(fileno(f), &sb) || !S_ISREG(sb.st_mode)) {
        error_set(err, EX_NOINPUT, "%s: cannot be opened as a file", path);
        goto failed;
    }
    if (ply_read_header(h, f, path, err) || ply_find_layout(l, h, path, err))
        goto failed;
    long at = ftell(f);
    if (at < 0 || h->n > ((size_t)sb.st_size - (size_t)at) / h->stride) {
        ply_bad_file(err, path,
                     "holds fewer than the %zu vertices its header names",
                     h->n);
        goto failed;
    }
    return f;
failed:
    if (f)
        fclose(f);
    return NULL;
}

int ply_read(struct ply_scene *s, const char *path, bool turn,
             struct error *err)
{
    struct header h;
    struct layout l;
    FILE *f = ply_open_scene(&h, &l, path, err);
    int rc = -1;

    memset(s, 0, sizeof *s);
    if (!f)
        return -1;
    s->turned = turn;
    if (!ply_scene_allocate(s, h.n, l.nrest, path, err))
        rc = ply_read_rows(s, f, &h, &l, path, err);
    fclose(f);
    if (rc)
        ply_release(s);
    return rc;
}

void ply_release(struct ply_scene *s)
{
    free(s->mean);
    memset(s, 0, sizeof *s);
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

/* Order, types and names of the properties. */
static void ply_lint_layout(struct lint *l, const struct header *h)
{
    size_t at = 0, order = 0, types = 0, extra = 0;

    for (size_t i = 0; i < h->count; i++) {
        const struct property *p = &h->property[i];
        size_t k = 0;

        while (k < FIELDS && strcmp(p->name, field_name[k]))
            k++;
        bool rest = !strncmp(p->name, "f_rest_", 7);
        types += p->type != F32;
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
    ply_lint_report(l, !ply_header_find(h, "nx"),
                    "no normals: viewers that read by position expect "
                    "nx ny nz");
    ply_lint_report(l, h->n == 0, "no Gaussians");
}

/* Counts what one row has wrong. */
static void ply_lint_row(const char *row, const struct layout *y,
                         size_t *not_unit, size_t *infinite,
                         size_t *linear_opacity, size_t *linear_scale)
{
    double q = 0;

    for (int k = 0; k < FIELDS; k++)
        if (y->field[k] && !isfinite(ply_row_number(row, y->field[k]))) {
            ++*infinite;
            break;
        }
    for (int k = 13; k < 17; k++)
        q += pow(ply_row_number(row, y->field[k]), 2);
    *not_unit += !(fabs(q - 1) < 1e-3);
    double o = ply_row_number(row, y->field[9]);
    *linear_opacity += o >= 0 && o <= 1;
    *linear_scale += ply_row_number(row, y->field[10]) > 0;
}

int ply_lint(const char *path, void (*say)(void *context, const char *text),
             void *context, struct error *err)
{
    struct lint l = {say, context, 0};
    struct header h;
    struct layout y;
    FILE *f = ply_open_scene(&h, &y, path, err);
    char *row = f ? malloc(h.stride + 1) : NULL;
    size_t not_unit = 0, infinite = 0, opacity = 0, scale = 0;

    if (!row) {
        if (f)
            fclose(f);
        return f ? error_set(err, EX_OSERR, "%s: out of memory", path) : -1;
    }
    ply_lint_layout(&l, &h);
    for (size_t i = 0; i < h.n && fread(row, h.stride, 1, f) == 1; i++)
        ply_lint_row(row, &y, &not_unit, &infinite, &opacity, &scale);
    ply_lint_report(&l, infinite, "%zu Gaussians have values that are not "
                    "finite: viewers show nothing or crash", infinite);
    ply_lint_report(&l, not_unit, "%zu rotations are not unit quaternions: "
                    "some viewers do not normalise them", not_unit);
    ply_lint_report(&l, h.n && opacity == h.n,
                    "every opacity lies in 0..1: are they linear? the layout "
                    "wants logits");
    ply_lint_report(&l, h.n && scale == h.n, "every scale is positive: are "
                    "they linear? the layout wants logarithms");
    fclose(f);
    free(row);
    return l.found;
}
