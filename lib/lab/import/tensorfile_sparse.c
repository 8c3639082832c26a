/* scipy's sparse matrices in full, of the forms that models are kept in: rows,
 * columns and triples.  They become entries (row, column, number), and those a
 * matrix. */
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/lab/import/tensorfile_impl.h"

/* Of a matrix: what its class keeps, and the entries. */
struct sparse {
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
    double *x;              /* malloc'd; NULL: none */
    size_t n;
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

/* An array of numbers of one dimension. */
static int sparse_row(struct row *out, const struct sparse *s,
                      const struct pickle_value *v)
{
    const struct pickle_array *a = tensorfile_array(v);
    void *packed;

    *out = (struct row){0};
    if (!a || !a->data || !a->known || a->view.ndim != 1)
        return sparse_fail(s, "has something else for an array of numbers");
    out->n = a->view.count;
    packed = malloc(out->n * st_dtype_size(a->view.dtype) + 1);
    out->x = malloc(out->n * sizeof *out->x + 1);
    if (packed && out->x) {
        array_view_copy(packed, &a->view, a->data);
        for (size_t i = 0; i < out->n; i++)
            out->x[i] = array_view_number(a->view.dtype, packed, i);
    }
    free(packed);
    return packed && out->x ? 0 : error_set(s->err, EX_OSERR, "out of memory");
}

static int sparse_add(struct sparse *s, double row, double column,
                      double value)
{
    if (s->n == s->room) {
        size_t room = s->room ? 2 * s->room : 256;
        struct entry *e = realloc(s->entry, room * sizeof *e);

        if (!e)
            return error_set(s->err, EX_OSERR, "out of memory");
        s->entry = e;
        s->room = room;
    }
    s->entry[s->n++] = (struct entry){row, column, value};
    return 0;
}

/* csr and csc (turned): line i holds entries start[i] to start[i+1]. */
static int sparse_lines(struct sparse *s, bool turned)
{
    struct row data = {0}, at = {0}, start = {0};
    const size_t lines = s->dim[turned];
    size_t from = 0;
    int rc = -1;

    if (sparse_row(&data, s, sparse_get(s, "data"))
        || sparse_row(&at, s, sparse_get(s, "indices"))
        || sparse_row(&start, s, sparse_get(s, "indptr")))
        goto out;
    if (data.n != at.n || start.n == 0 || start.n - 1 != lines ||
        (s->dim[1] && data.n / s->dim[1] > s->dim[0])) {
        error_set(s->err, EX_DATAERR, "sparse matrix of %zu by %zu has %zu "
                  "numbers, %zu indices and %zu starts", s->dim[0],
                  s->dim[1], data.n, at.n, start.n);
        goto out;
    }
    for (size_t i = 0; i < lines; i++) {
        double end = start.x[i + 1];

        if (!(end >= (double)from && end <= (double)at.n)) {
            sparse_fail(s, "has an index outside");
            goto out;
        }
        for (; from < (size_t)end; from++)
            if (sparse_add(s, turned ? at.x[from] : (double)i,
                           turned ? (double)i : at.x[from], data.x[from]))
                goto out;
    }
    rc = 0;
out:
    free(data.x);
    free(at.x);
    free(start.x);
    return rc;
}

/* coo: row, col and data, or since scipy 1.13 both in coords. */
static int sparse_triples(struct sparse *s)
{
    const struct pickle_value *coords = sparse_get(s, "coords");
    const struct pickle_value *side[2] = {sparse_get(s, "row"),
                                          sparse_get(s, "col")};
    struct row at[2] = {{0}}, data = {0};
    int rc = -1;

    if (coords && coords->kind == PICKLE_TUPLE && coords->u.list.n == 2)
        memcpy(side, coords->u.list.item, sizeof side);
    if (sparse_row(&at[0], s, side[0]) || sparse_row(&at[1], s, side[1])
        || sparse_row(&data, s, sparse_get(s, "data")))
        goto out;
    if (at[0].n != data.n || at[1].n != data.n) {
        sparse_fail(s, "has more numbers than places, or fewer");
        goto out;
    }
    rc = 0;
    for (size_t i = 0; i < data.n && !rc; i++)
        rc = sparse_add(s, at[0].x[i], at[1].x[i], data.x[i]);
out:
    free(at[0].x);
    free(at[1].x);
    free(data.x);
    return rc;
}

/* The form by the class's name: "csr_matrix", "csr_array".  1: of none. */
static int sparse_entries(struct sparse *s)
{
    struct pickle_text name = s->of->of.name;

    if (name.n < 4 || name.p[3] != '_')
        return 1;
    name.n = 3;
    return pickle_text_is(name, "csr") ? sparse_lines(s, false)
           : pickle_text_is(name, "csc") ? sparse_lines(s, true)
           : pickle_text_is(name, "coo") ? sparse_triples(s) : 1;
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
        p->view.count > (s->n > max / 64 ? max : 65536 + 64 * s->n)) {
        error_set(s->err, EX_DATAERR, "sparse matrix of %zu by %zu with %zu "
                  "entries (expected a smaller or fuller one)", s->dim[0],
                  s->dim[1], s->n);
        return NULL;
    }
    out = tensorfile_own(f, p->view.count * sizeof *out, s->err);
    if (out)
        memset(out, 0, p->view.count * sizeof *out);
    p->data = out;
    return out;
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
    free(s.entry);
    return rc;
}
