/* The tree of a pickle as a flat list of tensors with dotted names. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/tensorfile_impl.h"

/* The name so far; grows and shrinks as the walk goes down and up. */
struct path {
    char text[TENSORFILE_NAME];
    size_t n;
};

/* One UTF-8 character at p, at most n bytes: its length, or 0. */
static size_t flatten_utf8_length(const unsigned char *p, size_t n)
{
    size_t k = p[0] < 0x80 ? 1 : p[0] >> 5 == 6 ? 2 : p[0] >> 4 == 14 ? 3
               : p[0] >> 3 == 30 ? 4 : 0;
    unsigned c = k ? p[0] & (0xffu >> k) : 0;

    if (k == 1)
        return 1;
    if (k > n)
        return 0;
    for (size_t i = 1; i < k; i++) {
        if (p[i] >> 6 != 2)
            return 0;
        c = c << 6 | (p[i] & 63);
    }
    if (k < 2 || c < (k == 2 ? 0x80u : k == 3 ? 0x800u : 0x10000u) ||
        c > 0x10ffff || c >> 11 == 0x1b)
        return 0;
    return k;
}

/* Append a string to the name: text as it is, Python 2's bytes as latin1.
 * False when it does not fit or holds what no name should. */
static bool flatten_path_append(struct path *path, const struct pickle_value *v)
{
    const unsigned char *p = (const unsigned char *)v->u.s.p;
    size_t left = v->u.s.n;

    while (left) {
        size_t k = v->kind == PICKLE_TEXT ? flatten_utf8_length(p, left) : 1;

        if (!k || *p < 0x20 || *p == 0x7f || path->n + 5 > sizeof path->text)
            return false;
        if (v->kind == PICKLE_BYTES && *p >= 0x80) {
            path->text[path->n++] = (char)(0xc0 | *p >> 6);
            path->text[path->n++] = (char)(0x80 | (*p & 63));
        } else {
            memcpy(path->text + path->n, p, k);
            path->n += k;
        }
        p += k;
        left -= k;
    }
    path->text[path->n] = 0;
    return true;
}

/* Go down by a key; false: it cannot be in a name. */
static bool flatten_path_down(struct path *path, const struct pickle_value *key)
{
    if (path->n + 24 > sizeof path->text)
        return false;
    if (path->n)
        path->text[path->n++] = '.';
    if (key->kind == PICKLE_INT) {
        path->n += (size_t)sprintf(path->text + path->n, "%lld",
                                   (long long)key->u.i);
        return true;
    }
    path->text[path->n] = 0;
    return (key->kind == PICKLE_TEXT || key->kind == PICKLE_BYTES) &&
           flatten_path_append(path, key);
}

static int flatten_value(struct tensorfile *f, struct path *path,
                         const struct pickle_value *v, int depth,
                         struct error *err);

/* Each item under its key or number, one step further down the path. */
static int flatten_items(struct tensorfile *f, struct path *path,
                         const struct pickle_value *v, int depth,
                         struct error *err)
{
    const struct pickle_list *l = &v->u.list;
    size_t before = path->n, step = v->kind == PICKLE_DICT ? 2 : 1;
    int rc = 0;

    for (size_t i = 0; i < l->n && !rc; i += step) {
        struct pickle_value index = {.kind = PICKLE_INT,
                                     .u.i = (int64_t)i};

        if (flatten_path_down(path, step == 2 ? l->item[i] : &index))
            rc = flatten_value(f, path, l->item[i + step - 1], depth + 1, err);
        else
            tensorfile_add_other(f, path->text, "value under an odd key");
        path->n = before;
        path->text[before] = 0;
    }
    return rc;
}

/* An array of objects: one stands for itself. */
static int flatten_objects(struct tensorfile *f, struct path *path,
                           const struct pickle_value *v, int depth,
                           struct error *err)
{
    return v->u.list.n == 1
               ? flatten_value(f, path, v->u.list.item[0], depth + 1, err)
               : flatten_items(f, path, v, depth + 1, err);
}

/* An array of numbers, wherever they lie. */
static int flatten_array(struct tensorfile *f, struct path *path,
                         const struct pickle_array *a, struct error *err)
{
    struct tensor_place p = {.view = a->view, .data = a->data,
                             .entry = SIZE_MAX};

    if (!a->filled)
        return error_set(err, EX_DATAERR, "the array is never filled in");
    if (!a->known) {
        tensorfile_add_other(f, path->text, "array");
        return 0;
    }
    if (a->storage && a->storage->data) {
        p.data = (const char *)a->storage->data +
                 a->first * st_dtype_size(a->view.dtype);
    } else if (a->storage) {
        if (tensorfile_storage(&p, f, a->storage, err))
            return -1;
        if (p.data && a->view.count)
            p.data = (const char *)p.data +
                     a->first * st_dtype_size(a->view.dtype);
        else
            p.skip = a->first * st_dtype_size(a->view.dtype);
        p.view.swap = f->swap;
    }
    return tensorfile_add(f, path->text, &p, err);
}

/* Any value; nesting and the number of values are bounded, since shared ones
 * can make a small pickle endless. */
static int flatten_value(struct tensorfile *f, struct path *path,
                         const struct pickle_value *v, int depth,
                         struct error *err)
{
    struct tensor_place p = {.entry = SIZE_MAX};
    int rc;

    if (depth > TENSORFILE_DEPTH)
        return error_set(err, EX_DATAERR, "byte %zu: values are nested more "
                         "than %d deep", v->at, TENSORFILE_DEPTH);
    if (++f->visited > PICKLE_MAX_ITEMS)
        return error_set(err, EX_DATAERR, "byte %zu: more than %zu values, "
                         "shared ones counted again", v->at,
                         PICKLE_MAX_ITEMS);
    switch (v->kind) {
    case PICKLE_DICT:
    case PICKLE_LIST:
    case PICKLE_TUPLE:
        return flatten_items(f, path, v, depth, err);
    case PICKLE_CHUMPY:
        if (!v->u.inner)
            return error_set(err, EX_DATAERR, "byte %zu: '%s' is a chumpy "
                             "array without one", v->at, path->text);
        return flatten_value(f, path, v->u.inner, depth + 1, err);
    case PICKLE_ARRAY:
        if (v->u.array->objects)        /* their errors say where they are */
            return flatten_objects(f, path, v->u.array->objects, depth, err);
        rc = flatten_array(f, path, v->u.array, err);
        break;
    case PICKLE_SPARSE:
        rc = tensorfile_dense(&p, f, v->u.sparse, err) ||
             tensorfile_add(f, path->text, &p, err) ? -1 : 0;
        break;
    default:
        tensorfile_add_other(f, path->text, pickle_kind_name(v));
        return 0;
    }
    if (rc)
        error_prefix(err, "byte %zu: tensor '%s'", v->at, path->text);
    return rc;
}

int tensorfile_flatten(struct tensorfile *f, const char *name,
                       const struct pickle_value *v, struct error *err)
{
    struct path path = {.n = 0};

    path.n = (size_t)snprintf(path.text, sizeof path.text, "%s", name);
    if (path.n >= sizeof path.text)
        return error_set(err, EX_DATAERR, "name of more than %d bytes",
                         TENSORFILE_NAME);
    return flatten_value(f, &path, v, 0, err);
}

/* ---- sparse matrices ---------------------------------------------------- */

/* An array of one dimension as it is packed; malloc'd. */
static void *flatten_packed_row(const struct pickle_array *a, size_t *count,
                                const char *what, struct error *err)
{
    void *out;

    if (!a || !a->data || a->view.ndim != 1) {
        error_set(err, EX_DATAERR, "%s of a sparse matrix is no array of "
                  "numbers", what);
        return NULL;
    }
    *count = a->view.count;
    out = malloc(*count * st_dtype_size(a->view.dtype) + 1);
    if (!out) {
        error_set(err, EX_OSERR, "out of memory");
        return NULL;
    }
    array_view_copy(out, &a->view, a->data);
    return out;
}

/* Add the entries of the rows (csr) or columns (csc) to out (dim[0],dim[1]).
 * -1 when an index is outside. */
static int flatten_sparse(double *out, const struct pickle_sparse *s,
                          const void *data, const void *indices,
                          const void *starts, size_t entries)
{
    size_t lines = s->dim[s->rows ? 0 : 1], across = s->dim[s->rows ? 1 : 0];
    size_t from = 0;

    for (size_t i = 0; i < lines; i++) {
        double end = array_view_number(s->starts->view.dtype, starts, i + 1);

        if (!(end >= (double)from && end <= (double)entries))
            return -1;
        for (; from < (size_t)end; from++) {
            double at = array_view_number(s->indices->view.dtype, indices,
                                          from);

            if (!(at >= 0 && at < (double)across))
                return -1;
            out[s->rows ? i * s->dim[1] + (size_t)at
                        : (size_t)at * s->dim[1] + i] +=
                array_view_number(s->data->view.dtype, data, from);
        }
    }
    return 0;
}

/* The place of an owned matrix of doubles, all 0. */
static double *flatten_full_matrix(struct tensor_place *p, struct tensorfile *f,
                                   const struct pickle_sparse *s,
                                   size_t entries, struct error *err)
{
    const size_t most = TENSORFILE_SMALL / sizeof(double) / 8;
    double *out;

    *p = (struct tensor_place){.entry = SIZE_MAX};
    p->view.dtype = ST_F64;
    p->view.ndim = 2;
    p->view.dim[0] = s->dim[0];
    p->view.dim[1] = s->dim[1];
    if (!array_view_pack(&p->view, false) ||
        p->view.count > (entries > most / 64 ? most : 65536 + 64 * entries)) {
        error_set(err, EX_DATAERR, "sparse matrix of %zu by %zu with %zu "
                  "entries (expected a smaller or fuller one)", s->dim[0],
                  s->dim[1], entries);
        return NULL;
    }
    out = tensorfile_own(f, p->view.count * sizeof *out, err);
    if (out)
        memset(out, 0, p->view.count * sizeof *out);
    p->data = out;
    return out;
}

int tensorfile_dense(struct tensor_place *p, struct tensorfile *f,
                     const struct pickle_sparse *s, struct error *err)
{
    size_t entries = 0, places = 0, starts = 0;
    void *data = flatten_packed_row(s->data, &entries, "data", err);
    void *indices = data ? flatten_packed_row(s->indices, &places, "indices",
                                              err)
                         : NULL;
    void *start = indices
                      ? flatten_packed_row(s->starts, &starts, "indptr", err)
                      : NULL;
    double *out = NULL;
    int rc = -1;

    if (!start)
        goto out;
    if (entries != places || starts != s->dim[s->rows ? 0 : 1] + 1 ||
        (s->dim[1] && entries / s->dim[1] > s->dim[0])) {
        error_set(err, EX_DATAERR, "sparse matrix of %zu by %zu has %zu "
                  "numbers, %zu indices and %zu starts", s->dim[0],
                  s->dim[1], entries, places, starts);
        goto out;
    }
    out = flatten_full_matrix(p, f, s, entries, err);
    if (!out)
        goto out;
    rc = flatten_sparse(out, s, data, indices, start, entries);
    if (rc)
        error_set(err, EX_DATAERR, "sparse matrix of %zu by %zu has an index "
                  "outside", s->dim[0], s->dim[1]);
out:
    free(data);
    free(indices);
    free(start);
    return rc;
}
