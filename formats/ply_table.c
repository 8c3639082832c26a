/* The header of a PLY file, and its rows as numbers. */
#include "formats/ply_table.h"

#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>

#define LINE 256

static const struct {
    const char *name, *alias;
    size_t size;
} numbers[PLY_NUMBERS] = {
    {"char", "int8", 1}, {"uchar", "uint8", 1}, {"short", "int16", 2},
    {"ushort", "uint16", 2}, {"int", "int32", 4}, {"uint", "uint32", 4},
    {"float", "float32", 4}, {"double", "float64", 8}};

int ply_table_fail(const struct ply_table *t, struct error *err,
                   const char *format, ...)
{
    char text[300];
    va_list args;

    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    return error_set(err, EX_DATAERR, "%s: %s", t->path, text);
}

/* ---- the header --------------------------------------------------------- */

/* "property TYPE NAME" of the last element, or a list. */
static int ply_table_property(struct ply_table *t, const char *type,
                              const char *name, struct error *err)
{
    struct ply_element *e;
    struct ply_property *p;
    int k = 0;

    if (!t->elements)
        return ply_table_fail(t, err, "property %.60s before any element",
                              name);
    e = &t->element[t->elements - 1];
    p = &e->property[e->count];
    if (!strcmp(type, "list")) {
        e->lists = true;
        return 0;
    }
    while (k < PLY_NUMBERS && strcmp(type, numbers[k].name) &&
           strcmp(type, numbers[k].alias))
        k++;
    if (k == PLY_NUMBERS || e->count == PLY_PROPERTIES)
        return ply_table_fail(t, err, "property %.60s of type %.60s (expected "
                              "up to %d plain numbers)", name, type,
                              PLY_PROPERTIES);
    snprintf(p->name, sizeof p->name, "%s", name);
    p->type = (enum ply_number)k;
    p->offset = e->stride;
    e->stride += numbers[k].size;
    e->count++;
    return 0;
}

/* Any line of the header. */
static int ply_table_line(struct ply_table *t, const char *line,
                          struct error *err)
{
    static const char *const form[] = {
        [PLY_LITTLE] = "format binary_little_endian 1.0",
        [PLY_BIG] = "format binary_big_endian 1.0",
        [PLY_ASCII] = "format ascii 1.0"};
    char type[64], name[64];
    unsigned long long n;

    if (!*line || !strncmp(line, "comment", 7)
        || !strncmp(line, "obj_info", 8))
        return 0;
    for (int i = 0; i < 3; i++)
        if (!strcmp(line, form[i])) {
            t->form = (enum ply_form)i;
            return 0;
        }
    if (!strncmp(line, "format", 6))
        return ply_table_fail(t, err, "'%.60s' (expected format ascii, "
                              "binary_little_endian or binary_big_endian 1.0)",
                              line);
    if (sscanf(line, "element %63s %llu", name, &n) == 2) {
        struct ply_element *e = &t->element[t->elements];

        if (t->elements == PLY_ELEMENTS)
            return ply_table_fail(t, err, "more than %d elements",
                                  PLY_ELEMENTS);
        t->elements++;
        snprintf(e->name, sizeof e->name, "%s", name);
        e->n = (size_t)n;
        return 0;
    }
    if (sscanf(line, "property %63s %63s", type, name) == 2)
        return ply_table_property(t, type, name, err);
    return ply_table_fail(t, err, "header line '%.60s' is not understood",
                          line);
}

/* Up to end_header; afterwards the file stands at the first row. */
static int ply_table_header(struct ply_table *t, struct error *err)
{
    char line[LINE];

    if (!fgets(line, sizeof line, t->file) || strncmp(line, "ply", 3))
        return ply_table_fail(t, err, "not a PLY file");
    while (fgets(line, sizeof line, t->file)) {
        line[strcspn(line, "\r\n")] = 0;
        if (!strcmp(line, "end_header"))
            return 0;
        if (ply_table_line(t, line, err))
            return -1;
    }
    return ply_table_fail(t, err, "the header does not end");
}

/* Whether what is left of the file can hold the rows. */
static int ply_table_check_size(struct ply_table *t, size_t bytes,
                                struct error *err)
{
    size_t stride = 1;

    for (size_t i = 0; i < t->elements && !t->element[i].lists; i++) {
        const struct ply_element *e = &t->element[i];
        /* a digit and a blank, but for the last one */
        const size_t row = t->form == PLY_ASCII ? 2 * e->count : e->stride;

        if (row && e->n > (bytes + 1) / row)
            return ply_table_fail(t, err, "holds fewer than the %zu %s rows "
                                  "its header names", e->n, e->name);
        if (!row && e->n)
            return ply_table_fail(t, err, "rows of %s without properties",
                                  e->name);
        bytes -= row * e->n > bytes ? bytes : row * e->n;
        stride = e->stride > stride ? e->stride : stride;
    }
    t->row = malloc(stride);
    return t->row ? 0 : error_set(err, EX_OSERR, "out of memory");
}

struct ply_table *ply_table_open(const char *path, struct error *err)
{
    struct ply_table *t = calloc(1, sizeof *t);
    struct stat sb;
    long at;

    if (!t)
        return error_null(err, EX_OSERR, "%s: out of memory", path);
    t->path = path;
    t->file = fopen(path, "rb");
    if (!t->file || fstat(fileno(t->file), &sb) || !S_ISREG(sb.st_mode)) {
        error_set(err, EX_NOINPUT, "%s: cannot be opened as a file", path);
    } else if (!ply_table_header(t, err)) {
        at = ftell(t->file);
        if (at >= 0 && at <= sb.st_size
            && !ply_table_check_size(t, (size_t)(sb.st_size - at), err))
            return t;
    }
    ply_table_close(t);
    return NULL;
}

void ply_table_close(struct ply_table *t)
{
    if (!t)
        return;
    if (t->file)
        fclose(t->file);
    free(t->row);
    free(t);
}

const struct ply_element *ply_table_find(const struct ply_table *t,
                                         const char *name)
{
    for (size_t i = 0; i < t->elements; i++)
        if (!strcmp(t->element[i].name, name))
            return &t->element[i];
    return NULL;
}

const struct ply_property *ply_element_find(const struct ply_element *e,
                                            const char *name)
{
    for (size_t i = 0; i < e->count; i++)
        if (!strcmp(e->property[i].name, name))
            return &e->property[i];
    return NULL;
}

/* ---- rows --------------------------------------------------------------- */

/* A binary number as a double. */
static double ply_table_number(const char *p, enum ply_number type, bool big)
{
    union {
        int8_t i8; uint8_t u8; int16_t i16; uint16_t u16; int32_t i32;
        uint32_t u32; float f; double d;
        char byte[8];
    } v;
    const size_t size = numbers[type].size;

    for (size_t k = 0; k < size; k++)
        v.byte[k] = p[big ? size - 1 - k : k];
    switch (type) {
    case PLY_I8: return v.i8;
    case PLY_U8: return v.u8;
    case PLY_I16: return v.i16;
    case PLY_U16: return v.u16;
    case PLY_I32: return v.i32;
    case PLY_U32: return v.u32;
    case PLY_F32: return (double)v.f;
    default: return v.d;
    }
}

int ply_table_row(double *out, struct ply_table *t,
                  const struct ply_element *e, size_t i, struct error *err)
{
    bool there = t->form == PLY_ASCII || !e->stride
                 || fread(t->row, e->stride, 1, t->file) == 1;

    if (e->lists)
        return ply_table_fail(t, err, "element %s has lists (is this a "
                              "mesh?)", e->name);
    for (size_t k = 0; k < e->count && there; k++) {
        const struct ply_property *p = &e->property[k];

        if (t->form == PLY_ASCII)
            there = fscanf(t->file, "%lf", &out[k]) == 1;
        else
            out[k] = ply_table_number(t->row + p->offset, p->type,
                                      t->form == PLY_BIG);
    }
    if (there)
        return 0;
    if (feof(t->file))
        return ply_table_fail(t, err, "ends at %s %zu (expected %zu)",
                              e->name, i, e->n);
    return ply_table_fail(t, err, "%s %zu is not %zu numbers", e->name, i,
                          e->count);
}

int ply_table_skip_to(struct ply_table *t, const struct ply_element *e,
                      struct error *err)
{
    double skipped[PLY_PROPERTIES];

    for (const struct ply_element *s = t->element; s < e; s++)
        for (size_t i = 0; i < s->n; i++)
            if (ply_table_row(skipped, t, s, i, err))
                return -1;
    return 0;
}
