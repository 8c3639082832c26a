/* The table of known records of spid-stream(5), the check of a record against
 * it, and its arrays as pointers of a struct. */
#include "lib/stream/schema.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

static const struct schema table[] = {
    { RECORD_CONF, "json", "u8", "*", true,
      "JSON text: producer, units, camera" },
    { RECORD_SRCI, "rgb", "u8", "H,H,3", true, "sRGB source crop" },
    { RECORD_SRCI, "matte", "u8", "H,H", true, "coverage, 255 is the person" },
    { RECORD_SRCI, "crop", "f32", "3", true, "centre x, y and size, pixels" },
    { RECORD_SRCI, "back", "u8", "H,H,3", false,
      "what the person hides, sRGB" },
    { RECORD_SRCI, "sure", "u8", "H,H", false,
      "certainty of matte: 255 less twice its standard deviation" },
    { RECORD_SRCI, "rot", "f32", "3,3", false,
      "of a further picture, as in MOTN, like the next five" },
    { RECORD_SRCI, "trans", "f32", "3", false, "t, head units" },
    { RECORD_SRCI, "exp", "f32", "*", false, "psi, standard deviations" },
    { RECORD_SRCI, "jaw", "f32", "3", false, "axis-angle, radians" },
    { RECORD_SRCI, "lid", "f32", "2", false,
      "0 open to 1 closed, left, right" },
    { RECORD_SRCI, "eye", "f32", "6", false,
      "axis-angle, radians, left, right" },
    { RECORD_SRCI, "light", "f32", "3", false, "camera frame" },
    { RECORD_SHAP, "shape", "f32", "*", true, "beta, standard deviations" },
    { RECORD_SHAP, "offset", "f32", "V,3", false,
      "of vertices at rest, head units" },
    { RECORD_SHAP, "person", "i32", "1", false, "number of the person" },
    { RECORD_MOTN, "rot", "f32", "3,3", true, "R of x_cam = R x + t" },
    { RECORD_MOTN, "trans", "f32", "3", true, "t, head units" },
    { RECORD_MOTN, "exp", "f32", "*", true, "psi, standard deviations" },
    { RECORD_MOTN, "jaw", "f32", "3", true, "axis-angle, radians" },
    { RECORD_MOTN, "lid", "f32", "2", true, "0 open to 1 closed, left, right" },
    { RECORD_MOTN, "eye", "f32", "6", true,
      "axis-angle, radians, left, right" },
    { RECORD_MOTN, "crop", "f32", "3", false, "face crop, portrait pixels" },
    { RECORD_MOTN, "lmk", "f32", "68,2", false, "landmarks, portrait pixels" },
    { RECORD_MOTN, "points", "f32", "468,2", false,
      "dense landmarks, portrait pixels" },
    { RECORD_MOTN, "light", "f32", "3", false, "on the face, camera frame" },
    { RECORD_MOTN, "lost", "u8", "1", false,
      "1: no face, the last motion held" },
    { RECORD_MOTN, "calm", "f32", "*", false,
      "an identity's: expression, jaw and lids at rest" },
    { RECORD_MOTN, "sure", "f32", "1", false,
      "how sure the encoder is, 0 to 1" },
    { RECORD_MESH, "verts", "f32", "V,3", true, "vertices, head units" },
    { RECORD_MESH, "cam", "f32", "3,4", true, "[R|t], head units" },
    { RECORD_MESH, "lip", "f32", "3", true, "inner-lip centroid, head units" },
    { RECORD_MESH, "gap", "f32", "1", false,
      "opening of the lips, head units" },
    { RECORD_MESH, "chin", "f32", "3", false, "chin's centroid, head units" },
    { RECORD_MESH, "faces", "i32", "F,3", false, "triangles, vertex numbers" },
    { RECORD_GAUS, "mean", "f32", "N,3", true, "centres, head units" },
    { RECORD_GAUS, "scale", "f32", "N,3", true,
      "standard deviations, head units" },
    { RECORD_GAUS, "quat", "f32", "N,4", true, "w, x, y, z" },
    { RECORD_GAUS, "opacity", "f32", "N", true, "0 to 1" },
    { RECORD_GAUS, "color", "f16 f32", "N,C", true,
      "first three: sRGB, 0 to 1" },
    { RECORD_GAUS, "branch", "u8", "N", false, "0 dynamic, 1 static, 2 mouth" },
    { RECORD_GAUS, "cam", "f32", "3,4", false, "[R|t], head units" },
    { RECORD_GAUS, "lip", "f32", "3", false,
      "source's lip centroid, head units" },
    { RECORD_GAUS, "vertex", "i32", "M", false,
      "mesh vertex of each of branch 0" },
    { RECORD_GAUS, "bend", "f32", "N", false,
      "how much shoulders are in each" },
    { RECORD_GAUS, "pivot", "f32", "3", false, "in the neck, head units" },
    { RECORD_GAUS, "source", "f32", "3,3", false, "R of the source's camera" },
    { RECORD_GAUS, "light", "f32", "3", false, "on the source, head frame" },
    { RECORD_GAUS, "lamp", "f32", "6", false,
      "the light it is shown in, camera frame" },
    { RECORD_GAUS, "jaw", "f32", "K,3", false,
      "how the mouth goes with the chin" },
    { RECORD_GAUS, "chin", "f32", "3", false, "source's chin, head units" },
    { RECORD_GAUS, "uv", "f32", "N,2", false,
      "place in the source picture, 0..1" },
    { RECORD_GAUS, "seen", "f32", "N", false, "how far the source shows it" },
    { RECORD_GAUS, "view", "f32", "3,4", false,
      "[R|t] of the source's camera" },
    { RECORD_GAUS, "reach", "f32", "N", false,
      "how far it is shown from there" },
    { RECORD_GAUS, "normal", "f32", "N,3", false,
      "of the source's surface, head frame" },
    { RECORD_GAUS, "tilt", "f32", "N,2", false,
      "how its seen depth rises, right and down" },
    { RECORD_GAUS, "around", "f32", "N,2", false, "place in the grain, 0..1" },
    { RECORD_GAUS, "grain", "u8", "G,G", false,
      "what colours are times, times 128" },
    { RECORD_GMOV, "cam", "f32", "3,4", false, "[R|t], head units" },
    { RECORD_GMOV, "first", "i32", "1", false, "number of the first of mean" },
    { RECORD_GMOV, "mean", "f32", "M,3", false, "new centres, head units" },
    { RECORD_GMOV, "shift", "f32", "3", false,
      "of the mouth sheet, head units" },
    { RECORD_GMOV, "chin", "f32", "3", false, "the chin's shift, head units" },
    { RECORD_GMOV, "body", "f32", "3,4", false,
      "shoulders' motion, head frame" },
    { RECORD_FEAT, "feat", "f16 f32", "H,W,C|P,C", true, "first three: sRGB" },
    { RECORD_FEAT, "alpha", "f32", "H,W", true, "0 to 1" },
    { RECORD_FEAT, "photo", "f32", "H,W,5|P,5", false,
      "the photograph's share" },
    { RECORD_FEAT, "place", "f32", "H,W,4", false, "blended places" },
    { RECORD_FEAT, "map", "f32", "17", false, "their view" },
    { RECORD_FEAT, "grain", "u8", "Q,Q", false, "GAUS's, with the first place" },
    { RECORD_FEAT, "gain", "f32", "G,K", false, "how the light changed" },
    { RECORD_FEAT, "tint", "f32", "3", false, "and by its colour" },
    { RECORD_FEAT, "turn", "f32", "6", false, "of the head since the source" },
    { RECORD_FEAT, "depth", "f32", "H,W", false, "camera z, head units" },
    { RECORD_IMAG, "rgb", "u8", "H,W,3", true, "sRGB" },
    { RECORD_IMAG, "alpha", "u8", "H,W", false, "coverage" },
    { RECORD_IMAG, "mask", "u8", "H,W", false, "true coverage of the person" },
    { RECORD_IMAG, "label", "u8", "H,W", false, "region numbers" },
    { RECORD_IMAG, "alone", "u8", "H,W,3", false,
      "the person over black, sRGB" },
    { 0 }
};

const struct schema *schema_table(void)
{
    return table;
}

const struct schema *schema_find(const char *type, const char *name)
{
    for (const struct schema *s = table; s->type; s++)
        if (strcmp(s->type, type) == 0 && strcmp(s->name, name) == 0)
            return s;
    return NULL;
}

/* What the letters of a record's shapes stand for so far. */
struct letters {
    size_t bound[26];
    bool known[26];
};

/* Match the shape up to the next "|", binding letters. */
static bool schema_shape_matches(const char *shape, const struct array *a,
                                 struct letters *l)
{
    int k = 0;

    for (const char *p = shape; *p && *p != '|'; k++) {
        char *end = (char *)(uintptr_t)p + 1;

        if (k == a->ndim)
            return false;
        if (*p >= '0' && *p <= '9') {
            if (strtoul(p, &end, 10) != a->dim[k])
                return false;
        } else if (*p != '*') {
            int letter = *p - 'A';

            if (l->known[letter] && l->bound[letter] != a->dim[k])
                return false;
            l->known[letter] = true;
            l->bound[letter] = a->dim[k];
        }
        p = *end == ',' ? end + 1 : end;
    }
    return k == a->ndim;
}

/* The same for each of the shapes; letters are those of the one that fits. */
static bool schema_some_shape_matches(const char *shapes, const struct array *a,
                                      struct letters *l)
{
    for (const char *p = shapes; p; p = strchr(p, '|')) {
        struct letters attempt = *l;

        p += *p == '|';
        if (schema_shape_matches(p, a, &attempt)) {
            *l = attempt;
            return true;
        }
    }
    return false;
}

/* One row of the table: the array is there, of a dtype and shape allowed. */
static int schema_check_array(const struct schema *s, const struct record *rec,
                              struct letters *l, struct error *err)
{
    const struct array *a = record_find(rec, s->name);
    char found[100];
    int n;

    if (!a && !s->required)
        return 0;
    if (!a)
        return error_set(err, EX_DATAERR, "%s has no array '%s' (expected "
                         "%s[%s])", rec->type, s->name, s->dtypes, s->shape);
    if (strstr(s->dtypes, dtype_name(a->dtype)) &&
        schema_some_shape_matches(s->shape, a, l))
        return 0;
    n = snprintf(found, sizeof found, "%s[", dtype_name(a->dtype));
    for (int k = 0; k < a->ndim; k++)
        n += snprintf(found + n, sizeof found - (size_t)n, "%s%zu",
                      k ? "," : "", a->dim[k]);
    return error_set(err, EX_DATAERR, "%s %s is %s] (expected %s[%s])",
                     rec->type, s->name, found, s->dtypes, s->shape);
}

int schema_check(const struct record *rec, struct error *err)
{
    struct letters l = { .known = { false } };

    for (const struct schema *s = table; s->type; s++)
        if (memcmp(rec->type, s->type, 4) == 0 &&
            schema_check_array(s, rec, &l, err))
            return -1;
    return 0;
}

/* ---- records as structs ------------------------------------------------ */

int schema_read(void *out, const struct record *rec,
                const struct schema_field *field, size_t n, struct error *err)
{
    if (schema_check(rec, err) || record_check_finite(rec, err))
        return -1;
    for (size_t i = 0; i < n; i++) {
        const struct array *a = record_find(rec, field[i].name);

        if (a && a->dtype == field[i].dtype)
            memcpy((char *)out + field[i].at, &a->data, sizeof a->data);
    }
    return 0;
}

/* a's dimensions by the shape up to the next "|"; false where it has a letter
 * that stands for nothing. */
static bool schema_set_shape(struct array *a, const char *shape,
                             const size_t *size)
{
    for (a->ndim = 0; *shape && *shape != '|'; shape += *shape == ',') {
        const bool number = *shape >= '0' && *shape <= '9';
        char *end = (char *)(uintptr_t)shape + 1;
        const size_t n = number ? strtoul(shape, &end, 10)
                                : size[(unsigned char)*shape];

        if (n == SCHEMA_NOT)
            return false;
        a->dim[a->ndim++] = n;
        shape = end;
    }
    return true;
}

int schema_arrays(struct array *a, const char *type, const void *in,
                  const struct schema_field *field, size_t n,
                  const size_t *size)
{
    int count = 0;

    for (size_t i = 0; i < n; i++) {
        const void *data;

        memcpy(&data, (const char *)in + field[i].at, sizeof data);
        if (!data)
            continue;
        const char *shape = schema_find(type, field[i].name)->shape;
        struct array made = array_make(field[i].name, field[i].dtype, data, 0,
                                       0, 0, 0, 0);

        for (; shape; shape = strchr(shape, '|')) {
            struct array other = made;

            shape += *shape == '|';
            if (schema_set_shape(&other, shape, size))
                made = other;
        }
        a[count++] = made;
    }
    return count;
}

size_t schema_rows(const struct record *rec, const char *name)
{
    const struct array *a = record_find(rec, name);

    return a ? a->dim[0] : 0;
}
