/* NumPy's array files: header and data read with checks, and written row by
 * row. */
#include "formats/npy.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sysexits.h>

#include "formats/outfile.h"
#include "lib/base/file.h"

#define MAGIC "\x93NUMPY"
#define PREAMBLE 10            /* magic, version, u16 length: version 1 */
#define HEADER 128             /* preamble and text of the files we write */
#define TEXT_MAX 65536         /* longest header text we agree to parse */

/* ---- writing ---------------------------------------------------------- */

struct npy_writer {
    struct outfile out;
    enum dtype dtype;
    int ndim;
    size_t dim[4];
    size_t rows, bytes;        /* bytes of one row */
};

static const char *const descr[] = { "|u1", "<i4", "<f2", "<f4", "<f8" };

/* The header has a fixed size, so it can be written again at the end. */
static int npy_put_header(struct npy_writer *w, struct error *err)
{
    char head[HEADER + 1], shape[100] = "";
    size_t n = (size_t)snprintf(shape, sizeof shape, "%zu,", w->rows);

    for (int k = 0; k < w->ndim; k++)
        n += (size_t)snprintf(shape + n, sizeof shape - n, " %zu,", w->dim[k]);
    if (w->ndim)
        shape[n - 1] = '\0';   /* (3, 4) but (3,) */
    memset(head, ' ', sizeof head);
    memcpy(head, MAGIC "\1\0", 8);
    head[8] = HEADER - PREAMBLE;
    head[9] = 0;
    n = PREAMBLE + (size_t)snprintf(
        head + PREAMBLE, HEADER - PREAMBLE,
        "{'descr': '%s', 'fortran_order': False, 'shape': (%s), }",
        descr[w->dtype], shape);
    head[n] = ' ';
    head[HEADER - 1] = '\n';
    if (fseek(w->out.file, 0, SEEK_SET) ||
        fwrite(head, HEADER, 1, w->out.file) != 1)
        return outfile_error(&w->out, err);
    return 0;
}

void npy_abandon(struct npy_writer *w)
{
    if (w)
        outfile_abandon(&w->out);
    free(w);
}

struct npy_writer *npy_create(const char *path, enum dtype dtype, int ndim,
                              const size_t *dims, struct error *err)
{
    struct npy_writer *w = calloc(1, sizeof *w);

    if (!w)
        return error_null(err, EX_OSERR, "out of memory");
    w->dtype = dtype;
    w->ndim = ndim;
    w->bytes = dtype_size(dtype);
    for (int k = 0; k < ndim; k++) {
        w->dim[k] = dims[k];
        w->bytes *= dims[k];
    }
    if (!outfile_open(&w->out, path, err) && !npy_put_header(w, err))
        return w;
    npy_abandon(w);
    return NULL;
}

int npy_append(struct npy_writer *w, const void *data, struct error *err)
{
    if (w->bytes && fwrite(data, w->bytes, 1, w->out.file) != 1)
        return outfile_error(&w->out, err);
    w->rows++;
    return 0;
}

int npy_finish(struct npy_writer *w, struct error *err)
{
    int rc;

    if (!w)
        return 0;
    rc = npy_put_header(w, err);
    if (rc == 0)
        rc = outfile_close(&w->out, err);
    npy_abandon(w);
    return rc;
}

/* ---- reading ---------------------------------------------------------- */

/* Text after 'key': in a header, or NULL. */
static const char *npy_after_key(const char *text, const char *key)
{
    char quoted[32];
    const char *p;

    snprintf(quoted, sizeof quoted, "'%s'", key);
    p = strstr(text, quoted);
    if (!p)
        return NULL;
    p += strlen(quoted);
    p += strspn(p, " \t");
    if (*p != ':')
        return NULL;
    p++;
    return p + strspn(p, " \t");
}

/* '<f4' and its like; '|O' and what is not one of a few bytes has size 0. */
static int npy_parse_descr(struct npy_header *h, const char *p)
{
    h->kind = '?';
    if (!p || (*p != '\'' && *p != '['))
        return -1;
    if (*p == '[' || !p[1] || !strchr("<>|=", p[1]) || !p[2])
        return 0;
    h->swap = p[1] == '>';
    if (p[2] == 'O' && p[3] == '\'')
        h->kind = 'O';
    if (p[3] >= '1' && p[3] <= '8' && p[4] == '\'') {
        h->kind = p[2];
        h->size = (size_t)(p[3] - '0');
    }
    return 0;
}

/* The tuple after 'shape':; count is the product, refused over limit. */
static int npy_parse_shape(struct npy_header *h, size_t *count, const char *p,
                           size_t limit)
{
    unsigned __int128 n = 1;
    bool empty = false;

    if (!p || *p++ != '(')
        return -1;
    for (;;) {
        char *end;
        unsigned long long d;

        p += strspn(p, " ");
        if (*p == ')')
            break;
        if (*p < '0' || *p > '9' || h->ndim == 8)
            return -1;
        errno = 0;
        d = strtoull(p, &end, 10);
        if (errno || (*end != ',' && *end != ')'))
            return -1;
        h->dim[h->ndim++] = (size_t)d;
        if (d == 0)
            empty = true;
        else if ((n *= d) > limit)
            n = (unsigned __int128)limit + 1;
        p = *end == ',' ? end + 1 : end;
    }
    *count = empty ? 0 : (size_t)n;
    return !empty && n > limit ? -1 : 0;
}

/* The header text; left is how many bytes of data follow it. */
static int npy_parse_header(struct npy_header *h, size_t *count,
                            const char *text, size_t left, struct error *err)
{
    const char *order = npy_after_key(text, "fortran_order");

    if (npy_parse_descr(h, npy_after_key(text, "descr")))
        return error_set(err, EX_DATAERR, "the header has no dtype");
    h->fortran = order && strncmp(order, "True", 4) == 0;
    if (npy_parse_shape(h, count, npy_after_key(text, "shape"), left) ||
        (h->size && *count > left / h->size))
        return error_set(err, EX_DATAERR, "shape does not fit the %zu bytes "
                         "of data", left);
    return 0;
}

/* Bytes of the preamble, and of the text that follows it; 0 when head, the
 * first `have` bytes of a file, is not an npy file's. */
static size_t npy_preamble(size_t *text, const unsigned char *head, size_t have)
{
    size_t wide = have > 6 && head[6] > 1 ? 2 : 0;

    if (have < PREAMBLE + wide || memcmp(head, MAGIC, 6) != 0 ||
        head[6] < 1 || head[6] > 3)
        return 0;
    *text = head[8] | (size_t)head[9] << 8;
    if (wide)
        *text |= (size_t)head[10] << 16 | (size_t)head[11] << 24;
    return *text > TEXT_MAX ? 0 : PREAMBLE + wide;
}

int npy_header_read(struct npy_header *h, const void *head, size_t have,
                    size_t bytes, struct error *err)
{
    size_t size = 0, count, at = npy_preamble(&size, head, have);
    char *text;
    int rc;

    memset(h, 0, sizeof *h);
    if (!at || size > have - at)
        return error_set(err, EX_DATAERR, "not an npy file");
    text = strndup((const char *)head + at, size);
    if (!text)
        return error_set(err, EX_OSERR, "out of memory");
    h->bytes = at + size;
    rc = npy_parse_header(h, &count, text, bytes - h->bytes, err);
    free(text);
    return rc;
}

bool npy_view(struct array_view *v, const struct npy_header *h)
{
    *v = (struct array_view){.swap = h->swap, .ndim = h->ndim};
    memcpy(v->dim, h->dim, sizeof v->dim);
    return array_view_dtype(&v->dtype, h->kind, h->size) &&
           array_view_pack(v, h->fortran);
}

/* The array of a file's bytes. */
static int npy_read(struct npy *a, const char *file, size_t bytes,
                    struct error *err)
{
    struct npy_header h;
    struct array_view v;

    if (npy_header_read(&h, file, bytes, bytes, err))
        return -1;
    if (!npy_view(&v, &h) || h.ndim > 5)
        return error_set(err, EX_DATAERR, "dtype is not supported (expected "
                         "bool, integers, f2, f4 or f8, at most 5 "
                         "dimensions)");
    a->ndim = h.ndim;
    memcpy(a->dim, h.dim, sizeof a->dim);
    a->data = array_view_to_stream(&a->dtype, &v, file + h.bytes, err);
    return a->data ? 0 : -1;
}

int npy_load(struct npy *a, const char *path, struct error *err)
{
    size_t bytes;
    void *file = file_map(&bytes, path, err);

    *a = (struct npy){ 0 };
    if (!file)
        return -1;
    const int rc = npy_read(a, file, bytes, err) ? error_prefix(err, "%s", path)
                                                 : 0;
    munmap(file, bytes);
    return rc;
}

void npy_release(struct npy *a)
{
    free(a->data);
    *a = (struct npy){ 0 };
}
