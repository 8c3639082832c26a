/* scipy's sparse matrices in full.  Each form says where its numbers stand in
 * its own way: they become entries (row, column, number), and those a matrix.
 */
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/list.h"
#include "lib/lab/import/tensorfile_impl.h"

/* Of a matrix: what its class keeps, and the entries. */
struct sparse {
    struct arena memory;    /* of rows */
    const struct pickle_object *of;
    size_t dim[2];
    size_t n, room;
    struct entry {
        double row, column, value;      /* exact up to 2^53 */
    } *entry;
    struct error *err;
};

/* A row of numbers of the state, or of another array. */
struct row {
    double *x;
    size_t n;
    size_t block[2];        /* what follows the first dimension */
};

static const struct pickle_value *sparse_get(const struct sparse *s,
                                             const char *key)
{
    return s->of->state ? pickle_get(s->of->state, key) : NULL;
}

static int sparse_fail(const struct sparse *s, const char *what)
{
    return error_set(s->err, EX_DATAERR, "sparse matrix of %zu by %zu %s",
                     s->dim[0], s->dim[1], what);
}

/* An array of numbers, row-major, of ndim dimensions. */
static int sparse_row(struct row *out, struct sparse *s,
                      const struct pickle_value *v, int ndim)
{
    const struct pickle_array *a = tensorfile_array(v);
    void *packed;

    *out = (struct row){.n = 0, .block = {1, 1}};
    if (!a || !a->data || !a->known || a->view.ndim != ndim)
        return sparse_fail(s, "has something else for an array of numbers");
    out->n = a->view.count;
    for (int k = 1; k < ndim; k++)
        out->block[k - 1] = a->view.dim[k];
    packed = arena_take(&s->memory, out->n, st_dtype_size(a->view.dtype));
    out->x = arena_take(&s->memory, out->n, sizeof *out->x);
    if (arena_check(&s->memory, "a sparse matrix", s->err))
        return -1;
    array_view_copy(packed, &a->view, a->data);
    for (size_t i = 0; i < out->n; i++)
        out->x[i] = array_view_number(a->view.dtype, packed, i);
    return 0;
}

static int sparse_add(struct sparse *s, double row, double column,
                      double value)
{
    struct entry *e = list_add(&s->entry, &s->n, &s->room, sizeof *e, s->err);

    if (!e)
        return -1;
    *e = (struct entry){row, column, value};
    return 0;
}

/* csr, csc (turned) and bsr: line i holds entries start[i] to start[i+1], each
 * a block of numbers. */
static int sparse_lines(struct sparse *s, bool rotated, bool blocks)
{
    struct row data, at, start;
    size_t lines, inside, from = 0;

    if (sparse_row(&data, s, sparse_get(s, "data"), blocks ? 3 : 1)
        || sparse_row(&at, s, sparse_get(s, "indices"), 1)
        || sparse_row(&start, s, sparse_get(s, "indptr"), 1))
        return -1;
    inside = data.block[0] * data.block[1];
    lines = s->dim[rotated] / (data.block[0] ? data.block[0] : 1);
    if (data.n != at.n * inside || start.n == 0 || start.n - 1 != lines ||
        (s->dim[1] && data.n / s->dim[1] > s->dim[0]))
        return error_set(s->err, EX_DATAERR, "sparse matrix of %zu by %zu has "
                         "%zu numbers, %zu indices and %zu starts", s->dim[0],
                         s->dim[1], data.n, at.n, start.n);
    for (size_t i = 0; i < lines; i++) {
        double end = start.x[i + 1];

        if (!(end >= (double)from && end <= (double)at.n))
            return sparse_fail(s, "has an index outside");
        for (; from < (size_t)end; from++)
            for (size_t k = 0; k < inside; k++) {
                double line = (double)(i * data.block[0] + k / data.block[1]);
                double across = at.x[from] * (double)data.block[1]
                                + (double)(k % data.block[1]);

                if (sparse_add(s, rotated ? across : line,
                               rotated ? line : across,
                               data.x[from * inside + k]))
                    return -1;
            }
    }
    return 0;
}

/* coo: row, col and data, or since scipy 1.13 both in coords. */
static int sparse_triples(struct sparse *s)
{
    const struct pickle_value *coords = sparse_get(s, "coords");
    const struct pickle_value *side[2] = {sparse_get(s, "row"),
                                          sparse_get(s, "col")};
    struct row at[2], data;

    if (coords && coords->kind == PICKLE_TUPLE && coords->u.list.n == 2)
        memcpy(side, coords->u.list.item, sizeof side);
    if (sparse_row(&at[0], s, side[0], 1) || sparse_row(&at[1], s, side[1], 1)
        || sparse_row(&data, s, sparse_get(s, "data"), 1))
        return -1;
    if (at[0].n != data.n || at[1].n != data.n)
        return sparse_fail(s, "has more numbers than places, or fewer");
    for (size_t i = 0; i < data.n; i++)
        if (sparse_add(s, at[0].x[i], at[1].x[i], data.x[i]))
            return -1;
    return 0;
}

/* dia: row k of data is a diagonal, its number j in column j. */
static int sparse_diagonals(struct sparse *s)
{
    struct row data, offset;

    if (sparse_row(&data, s, sparse_get(s, "data"), 2)
        || sparse_row(&offset, s, sparse_get(s, "offsets"), 1))
        return -1;
    if (data.n != offset.n * data.block[0])
        return sparse_fail(s, "has more diagonals than offsets, or fewer");
    for (size_t i = 0; i < data.n; i++) {
        double column = (double)(i % data.block[0]);
        double row = column - offset.x[i / data.block[0]];

        /* what of a diagonal lies outside is not there */
        if (row >= 0 && row < (double)s->dim[0]
            && column < (double)s->dim[1]
            && sparse_add(s, row, column, data.x[i]))
            return -1;
    }
    return 0;
}

/* A number of Python's or numpy's. */
static bool sparse_number(double *out, const struct pickle_value *v)
{
    const struct pickle_array *a = tensorfile_array(v);

    if (v->kind == PICKLE_INT || v->kind == PICKLE_BOOL)
        *out = (double)v->u.i;
    else if (v->kind == PICKLE_FLOAT)
        *out = v->u.f;
    else if (a && a->data && a->known && a->view.count == 1)
        *out = array_view_number(a->view.dtype, a->data, 0);
    else
        return false;
    return !a || !a->view.swap;
}

/* The list that row i of an array of objects is; NULL: it is none. */
static const struct pickle_list *sparse_list(const struct pickle_array *a,
                                             size_t i)
{
    const struct pickle_value *v = a && a->objects && i < a->objects->u.list.n
                                       ? a->objects->u.list.item[i] : NULL;

    return v && v->kind == PICKLE_LIST ? &v->u.list : NULL;
}

/* lil: for each row the columns, and the numbers, as lists. */
static int sparse_lists(struct sparse *s)
{
    const struct pickle_array *rows = tensorfile_array(sparse_get(s, "rows"));
    const struct pickle_array *data = tensorfile_array(sparse_get(s, "data"));
    double at, x;

    if (!rows || !rows->objects || rows->objects->u.list.n != s->dim[0])
        return sparse_fail(s, "has no list for each row");
    for (size_t i = 0; i < s->dim[0]; i++) {
        const struct pickle_list *r = sparse_list(rows, i);
        const struct pickle_list *d = sparse_list(data, i);

        if (!r || !d || r->n != d->n)
            return sparse_fail(s, "has no list of numbers for each of places");
        for (size_t k = 0; k < r->n; k++)
            if (!sparse_number(&at, r->item[k])
                || !sparse_number(&x, d->item[k]))
                return sparse_fail(s, "has something else for a number");
            else if (sparse_add(s, (double)i, at, x))
                return -1;
    }
    return 0;
}

/* dok: a dictionary from (row, column) to a number, since scipy 1.12 one of
 * its attributes. */
static int sparse_keys(struct sparse *s)
{
    const struct pickle_value *dict = sparse_get(s, "_dict");
    double row, column, x;

    if (!dict)
        dict = s->of->items;
    if (!dict)
        return 0;               /* empty */
    if (dict->kind != PICKLE_DICT)
        return sparse_fail(s, "has no dictionary of numbers");
    for (size_t i = 0; i < dict->u.list.n; i += 2) {
        const struct pickle_value *key = dict->u.list.item[i];

        if (key->kind != PICKLE_TUPLE || key->u.list.n != 2
            || !sparse_number(&row, key->u.list.item[0])
            || !sparse_number(&column, key->u.list.item[1])
            || !sparse_number(&x, dict->u.list.item[i + 1]))
            return sparse_fail(s, "has something else for a place");
        if (sparse_add(s, row, column, x))
            return -1;
    }
    return 0;
}

/* The form by the class's name: "csr_matrix", "csr_array".  1: of none. */
static int sparse_entries(struct sparse *s)
{
    struct pickle_text name = s->of->of.name;

    if (name.n < 4 || name.p[3] != '_')
        return 1;
    name.n = 3;
    return pickle_text_is(name, "csr") ? sparse_lines(s, false, false)
           : pickle_text_is(name, "csc") ? sparse_lines(s, true, false)
           : pickle_text_is(name, "bsr") ? sparse_lines(s, false, true)
           : pickle_text_is(name, "coo") ? sparse_triples(s)
           : pickle_text_is(name, "dia") ? sparse_diagonals(s)
           : pickle_text_is(name, "lil") ? sparse_lists(s)
           : pickle_text_is(name, "dok") ? sparse_keys(s) : 1;
}

/* Rows and columns; 1: it has not two dimensions. */
static int sparse_shape(struct sparse *s)
{
    const struct pickle_value *v = sparse_get(s, "_shape");

    if (!v || v->kind != PICKLE_TUPLE || v->u.list.n != 2)
        return 1;
    for (int i = 0; i < 2; i++) {
        const struct pickle_value *n = v->u.list.item[i];

        if (n->kind != PICKLE_INT || n->u.i < 0)
            return 1;
        s->dim[i] = (size_t)n->u.i;
    }
    return 0;
}

/* The place of an owned matrix of doubles, all 0. */
static double *sparse_matrix(struct tensor_place *p, struct tensorfile *f,
                             const struct sparse *s)
{
    const size_t max = TENSORFILE_SMALL / sizeof(double) / 8;
    double *out;

    *p = (struct tensor_place){.entry = SIZE_MAX};
    p->view.dtype = ST_F64;
    p->view.ndim = 2;
    p->view.dim[0] = s->dim[0];
    p->view.dim[1] = s->dim[1];
    if (!array_view_pack(&p->view, false) ||
        p->view.count > (s->n > max / 64 ? max : 65536 + 64 * s->n))
        return error_null(s->err, EX_DATAERR, "sparse matrix of %zu by %zu "
                          "with %zu entries (expected a smaller or fuller "
                          "one)", s->dim[0], s->dim[1], s->n);
    p->data = out = arena_take(&f->memory, p->view.count, sizeof *out);
    return arena_check(&f->memory, "a sparse matrix", s->err) ? NULL : out;
}

bool tensorfile_is_sparse(const struct pickle_object *o)
{
    return pickle_text_begins(o->of.module, "scipy.sparse");
}

int tensorfile_dense(struct tensor_place *p, struct tensorfile *f,
                     const struct pickle_object *o, struct error *err)
{
    struct sparse s = {.of = o, .err = err};
    int rc = sparse_shape(&s);
    double *out;

    if (!rc)
        rc = sparse_entries(&s);
    out = rc ? NULL : sparse_matrix(p, f, &s);
    if (!rc && !out)
        rc = -1;
    for (size_t i = 0; i < s.n && !rc; i++) {
        const struct entry *e = &s.entry[i];

        if (e->row >= 0 && e->row < (double)s.dim[0] && e->column >= 0
            && e->column < (double)s.dim[1])
            out[(size_t)e->row * s.dim[1] + (size_t)e->column] += e->value;
        else
            rc = sparse_fail(&s, "has an index outside");
    }
    arena_release(&s.memory);
    free(s.entry);
    return rc;
}
