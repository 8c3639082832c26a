/* Wavefront OBJ and MakeHuman's .mhclo, line by line. */
#include "lib/lab/people/wavefront.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/list.h"

#define VERTICES_MAX ((size_t)4 << 20)

/* ---- what both formats need -------------------------------------------- */

/* A growing array of items of `size` bytes. */
struct list {
    char *data;
    size_t count, room, size;
};

/* Room for one more item, NULL when memory or VERTICES_MAX is used up. */
static void *wavefront_list_add(struct list *l)
{
    return l->count < VERTICES_MAX
               ? list_add(&l->data, &l->count, &l->room, l->size, NULL) : NULL;
}

struct lines {
    FILE *f;
    const char *path;
    size_t number;
    char text[1024];
};

static int wavefront_open(struct lines *in, const char *path, struct error *err)
{
    in->f = fopen(path, "r");
    in->path = path;
    in->number = 0;
    return in->f ? 0 : error_set(err, EX_NOINPUT, "%s: %s", path,
                                 strerror(errno));
}

/* The next line: 1, or 0 at the end. */
static bool wavefront_next(struct lines *in)
{
    if (!fgets(in->text, sizeof in->text, in->f))
        return false;
    in->number++;
    return true;
}

static int wavefront_bad(const struct lines *in, const char *what,
                         struct error *err)
{
    return error_set(err, EX_DATAERR, "%s: line %zu: %s", in->path,
                     in->number, what);
}

/* n finite numbers of the text. */
static bool wavefront_parse_floats(float *out, int n, const char *text)
{
    char *end;

    for (int i = 0; i < n; i++) {
        out[i] = strtof(text, &end);
        if (end == text || !isfinite(out[i]))
            return false;
        text = end;
    }
    return true;
}

/* ---- OBJ ---------------------------------------------------------------- */

struct mesh_lists {
    struct list v, vt, f, ft;
    bool skip;              /* faces of another group */
};

/* Corners "v", "v/vt" or "v/vt/vn", from 1. */
static int wavefront_parse_face(struct mesh_lists *l, const struct lines *in,
                                struct error *err)
{
    const char *p = in->text + 1;
    int32_t v[16], t[16];
    int n = 0;
    char *end;

    for (; n < 16; n++) {
        long a = strtol(p, &end, 10), b = 0;
        if (end == p)
            break;
        p = end;
        if (*p == '/' && p[1] != '/') {
            b = strtol(p + 1, &end, 10);
            p = end;
        }
        while (*p && *p != ' ' && *p != '\t' && *p != '\n')
            p++;
        if (a < 1 || a > (long)VERTICES_MAX || b < 0
            || b > (long)VERTICES_MAX)
            return wavefront_bad(in, "corner out of range", err);
        v[n] = (int32_t)a - 1;
        t[n] = (int32_t)b - 1;
    }
    if (n < 3)
        return wavefront_bad(in, "face of fewer than three corners", err);
    for (int i = 1; i + 1 < n; i++) {
        int32_t *f = wavefront_list_add(&l->f);
        int32_t *ft = wavefront_list_add(&l->ft);
        if (!f || !ft)
            return wavefront_bad(in, "too many faces", err);
        f[0] = v[0], f[1] = v[i], f[2] = v[i + 1];
        ft[0] = t[0], ft[1] = t[i], ft[2] = t[i + 1];
    }
    return 0;
}

/* Groups, vertices, texture places and faces; other lines are passed over. */
static int wavefront_parse_line(struct mesh_lists *l, const struct lines *in,
                                const char *group, struct error *err)
{
    const char *s = in->text;
    float *p;

    if (s[0] == 'g' && (s[1] == ' ' || s[1] == '\t')) {
        size_t n = group ? strlen(group) : 0;
        l->skip = group && (strncmp(s + 2, group, n)
                            || (s[2 + n] && !strchr(" \r\n", s[2 + n])));
    } else if (s[0] == 'v' && (s[1] == ' ' || s[1] == 't')) {
        bool place = s[1] == ' ';
        p = wavefront_list_add(place ? &l->v : &l->vt);
        if (!p)
            return wavefront_bad(in, "too many vertices", err);
        if (!wavefront_parse_floats(p, place ? 3 : 2, s + 2))
            return wavefront_bad(in, "expected finite numbers", err);
    } else if (s[0] == 'f' && s[1] == ' ' && !l->skip) {
        return wavefront_parse_face(l, in, err);
    }
    return 0;
}

/* Every corner lies in the lists; texture coordinates all or none. */
static int wavefront_check_corners(const struct mesh_lists *l, const char *path,
                                   struct error *err)
{
    const int32_t *f = (int32_t *)(void *)l->f.data;
    const int32_t *t = (int32_t *)(void *)l->ft.data;

    if (!l->f.count)
        return error_set(err, EX_DATAERR, "%s: no faces (expected a mesh)",
                         path);
    for (size_t i = 0; i < 3 * l->f.count; i++)
        if ((size_t)f[i] >= l->v.count
            || (l->vt.count && (t[i] < 0 || (size_t)t[i] >= l->vt.count)))
            return error_set(err, EX_DATAERR, "%s: face %zu has corner %d "
                             "(expected one of %zu vertices)", path, i / 3,
                             f[i] + 1, l->v.count);
    return 0;
}

int wavefront_read(struct wavefront *m, const char *path, const char *group,
                   struct arena *memory, struct error *err)
{
    struct lines in;
    struct mesh_lists l = {.v = {.size = 12}, .vt = {.size = 8},
                           .f = {.size = 12}, .ft = {.size = 12},
                           .skip = group != NULL};
    int rc = 0;

    if (wavefront_open(&in, path, err))
        return -1;
    while (!rc && wavefront_next(&in))
        rc = wavefront_parse_line(&l, &in, group, err);
    if (!rc && ferror(in.f))
        rc = error_set(err, EX_IOERR, "%s: cannot be read", path);
    fclose(in.f);
    if (!rc)
        rc = wavefront_check_corners(&l, path, err);
    *m = (struct wavefront){
        .nv = l.v.count, .nt = l.vt.count, .nf = l.f.count,
        .v = arena_keep(memory, l.v.data, err),
        .vt = arena_keep(memory, l.vt.data, err),
        .f = arena_keep(memory, l.f.data, err),
        .ft = arena_keep(memory, l.ft.data, err)
    };
    return rc || !m->v || !m->f || !m->ft || (l.vt.count && !m->vt) ? -1 : 0;
}

/* ---- .mhclo ------------------------------------------------------------- */

/* "x_scale a b d" */
static int wavefront_parse_scale(struct mhclo *m, const struct lines *in,
                                 int axis, size_t nbase, struct error *err)
{
    float v[3];

    if (!wavefront_parse_floats(v, 3, in->text + 7) || v[0] < 0 || v[1] < 0
        || v[0] >= (float)nbase || v[1] >= (float)nbase || v[2] == 0)
        return wavefront_bad(in, "expected two base vertices and a length",
                             err);
    m->ruler[axis][0] = (int32_t)v[0];
    m->ruler[axis][1] = (int32_t)v[1];
    m->length[axis] = v[2];
    return 0;
}

/* "k" or "k0 k1 k2 w0 w1 w2 dx dy dz" as vertex i. */
static int wavefront_parse_vertex(struct mhclo *m, const struct lines *in,
                                  size_t i, size_t nbase, struct error *err)
{
    float v[9] = {0, 0, 0, 1, 0, 0, 0, 0, 0};

    if (!wavefront_parse_floats(v, 9, in->text)) {
        float k;
        if (!wavefront_parse_floats(&k, 1, in->text))
            return wavefront_bad(in, "expected numbers", err);
        memset(v, 0, sizeof v);
        v[0] = v[1] = v[2] = k;
        v[3] = 1;
    }
    for (int k = 0; k < 3; k++) {
        if (v[k] < 0 || v[k] >= (float)nbase)
            return wavefront_bad(in, "base vertex out of range", err);
        m->index[3 * i + (size_t)k] = (int32_t)v[k];
        m->weight[3 * i + (size_t)k] = v[3 + k];
        m->offset[3 * i + (size_t)k] = v[6 + k];
    }
    return 0;
}

/* "a - b c d - e": base vertices that the asset covers. */
static void wavefront_parse_hidden(struct mhclo *m, const char *p, size_t nbase)
{
    long last = -1;
    bool range = false;

    while (*p) {
        char *end;
        long v = strtol(p, &end, 10);
        if (end == p || *p == '-') {
            range = range || *p == '-';
            p++;
            continue;
        }
        p = end;
        if (v < 0 || (size_t)v >= nbase)
            continue;
        for (long i = range && last >= 0 ? last : v; i <= v; i++)
            m->hidden[i] = 1;
        range = false;
        last = v;
    }
}

/* Scales, then a row for each vertex of the mesh, then what it hides. */
static int wavefront_parse_mhclo(struct mhclo *m, struct lines *in,
                                 size_t nbase, size_t n, struct error *err)
{
    bool verts = false, hidden = false;

    while (wavefront_next(in)) {
        const char *s = in->text;
        while (*s == ' ' || *s == '\t')
            s++;
        bool number = (*s >= '0' && *s <= '9') || *s == '-';
        if (!strncmp(s, "delete_verts", 12)) {
            hidden = true;
            continue;
        }
        if (hidden) {
            wavefront_parse_hidden(m, s, nbase);
            continue;
        }
        if (!strncmp(s, "verts ", 6))
            verts = true;
        else if (s[0] >= 'x' && s[0] <= 'z' && !strncmp(s + 1, "_scale", 6)
                 && wavefront_parse_scale(m, in, s[0] - 'x', nbase, err))
            return -1;
        if (!verts || !number)
            continue;
        if (m->n == n)
            return wavefront_bad(in, "more vertices than the mesh has", err);
        if (wavefront_parse_vertex(m, in, m->n, nbase, err))
            return -1;
        m->n++;
    }
    if (m->n != n)
        return error_set(err, EX_DATAERR, "%s: %zu vertices (expected %zu as "
                         "in its mesh)", in->path, m->n, n);
    for (int k = 0; k < 3; k++)
        if (m->length[k] == 0)
            return error_set(err, EX_DATAERR, "%s: no %c_scale (expected "
                             "one)", in->path, 'x' + k);
    return 0;
}

int mhclo_read(struct mhclo *m, const char *path, size_t nbase, size_t n,
               struct arena *memory, struct error *err)
{
    struct lines in;
    int rc;

    *m = (struct mhclo){
        .index = arena_take(memory, 3 * n, sizeof *m->index),
        .weight = arena_take(memory, 3 * n, sizeof *m->weight),
        .offset = arena_take(memory, 3 * n, sizeof *m->offset),
        .hidden = arena_take(memory, nbase, 1)
    };
    if (arena_check(memory, path, err) || wavefront_open(&in, path, err))
        return -1;
    rc = wavefront_parse_mhclo(m, &in, nbase, n, err);
    fclose(in.f);
    return rc;
}

void mhclo_place(float *out, const struct mhclo *m, const float *base)
{
    float scale[3];

    for (int k = 0; k < 3; k++)
        scale[k] = fabsf(base[3 * m->ruler[k][0] + k]
                         - base[3 * m->ruler[k][1] + k]) / m->length[k];
    for (size_t i = 0; i < m->n; i++)
        for (size_t k = 0; k < 3; k++) {
            float x = scale[k] * m->offset[3 * i + k];
            for (size_t c = 0; c < 3; c++)
                x += m->weight[3 * i + c]
                     * base[3 * (size_t)m->index[3 * i + c] + k];
            out[3 * i + k] = x;
        }
}
