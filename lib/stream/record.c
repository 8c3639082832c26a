/* Arrays and records in memory: shapes, look-up, checks. */
#include "lib/stream/stream.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/stream/layout.h"

static const struct {
    const char *name;
    size_t size;
} dtypes[] = {
    [DTYPE_U8] = { "u8", 1 },   [DTYPE_I32] = { "i32", 4 },
    [DTYPE_F16] = { "f16", 2 }, [DTYPE_F32] = { "f32", 4 },
    [DTYPE_F64] = { "f64", 8 },
};

size_t dtype_size(enum dtype t)
{
    return dtypes[t].size;
}

const char *dtype_name(enum dtype t)
{
    return dtypes[t].name;
}

size_t array_count(const struct array *a)
{
    size_t n = 1;

    for (int k = 0; k < a->ndim; k++)
        n *= a->dim[k];
    return n;
}

size_t array_bytes(const struct array *a)
{
    return array_count(a) * dtype_size(a->dtype);
}

struct array array_make(const char *name, enum dtype dtype, const void *data,
                        int ndim, size_t d0, size_t d1, size_t d2, size_t d3)
{
    struct array a = { .dtype = dtype, .ndim = ndim, .data = data };
    const size_t dim[4] = { d0, d1, d2, d3 };

    snprintf(a.name, sizeof a.name, "%s", name);
    for (int k = 0; k < ndim; k++)
        a.dim[k] = dim[k];
    return a;
}

bool record_is(const struct record *rec, const char *type)
{
    return strcmp(rec->type, type) == 0;
}

const struct array *record_find(const struct record *rec, const char *name)
{
    for (int i = 0; i < rec->count; i++)
        if (strcmp(rec->array[i].name, name) == 0)
            return &rec->array[i];
    return NULL;
}

/* "f32[20018,3]"; a dimension of 0 in an expected shape shows as '*'. */
static void record_shape_text(char *text, size_t size, enum dtype dtype,
                              int ndim, const size_t *dims, bool any)
{
    size_t n = (size_t)snprintf(text, size, "%s[", dtype_name(dtype));

    for (int k = 0; k < ndim && n < size; k++) {
        if (any && dims[k] == 0)
            n += (size_t)snprintf(text + n, size - n, "%s*", k ? "," : "");
        else
            n += (size_t)snprintf(text + n, size - n, "%s%zu", k ? "," : "",
                                  dims[k]);
    }
    if (n < size)
        snprintf(text + n, size - n, "]");
}

const void *record_get(const struct record *rec, const char *name,
                       enum dtype dtype, int ndim, const size_t *dims,
                       struct error *err)
{
    const struct array *a = record_find(rec, name);
    char found[120], expected[120];
    bool same;

    record_shape_text(expected, sizeof expected, dtype, ndim, dims, true);
    if (!a)
        return error_null(err, EX_DATAERR, "%s has no array '%s' (expected "
                          "%s)", rec->type, name, expected);
    same = a->dtype == dtype && a->ndim == ndim;
    for (int k = 0; same && k < ndim; k++)
        same = dims[k] == 0 || dims[k] == a->dim[k];
    if (!same) {
        record_shape_text(found, sizeof found, a->dtype, a->ndim, a->dim,
                          false);
        return error_null(err, EX_DATAERR, "%s %s is %s (expected %s)",
                          rec->type, name, found, expected);
    }
    return a->data;
}

int record_others(struct array *out, int used, const struct record *rec,
                  const char *const *known)
{
    int n = 0;

    for (int i = 0; i < rec->count && used + n < STREAM_MAX_ARRAYS; i++) {
        const char *const *k = known;

        while (*k && strcmp(*k, rec->array[i].name) != 0)
            k++;
        if (!*k)
            out[n++] = rec->array[i];
    }
    return n;
}

void *record_keep(struct record *to, const struct record *rec,
                  struct error *err)
{
    size_t bytes = 0;
    char *block, *at;

    for (int i = 0; i < rec->count; i++)
        bytes += layout_align(array_bytes(&rec->array[i]));
    at = block = aligned_alloc(STREAM_ALIGN, bytes + STREAM_ALIGN);
    if (!block)
        return error_null(err, EX_OSERR, "no memory for %s of %zu bytes",
                          rec->type, bytes);
    *to = *rec;
    to->payload = NULL;
    for (int i = 0; i < rec->count; i++) {
        bytes = array_bytes(&rec->array[i]);
        if (bytes)
            memcpy(at, rec->array[i].data, bytes);
        to->array[i].data = at;
        at += layout_align(bytes);
    }
    return block;
}

/* Index of the first element whose exponent is all ones, or n.  Whole blocks
 * are tested without a branch, so that the loop becomes vector code. */
#define DEFINE_FIRST_BAD(name, type, mask)                                  \
    static size_t name(const void *data, size_t n)                          \
    {                                                                       \
        const type *x = data;                                               \
        size_t i = 0;                                                       \
                                                                            \
        for (; i + 256 <= n; i += 256) {                                    \
            unsigned bad = 0;                                               \
            _Pragma("omp simd reduction(|:bad)")                            \
            for (size_t j = 0; j < 256; j++)                                \
                bad |= (x[i + j] & (mask)) == (mask);                       \
            if (bad)                                                        \
                break;                                                      \
        }                                                                   \
        while (i < n && (x[i] & (mask)) != (mask))                          \
            i++;                                                            \
        return i;                                                           \
    }

DEFINE_FIRST_BAD(first_bad16, uint16_t, 0x7c00u)
DEFINE_FIRST_BAD(first_bad32, uint32_t, 0x7f800000u)
DEFINE_FIRST_BAD(first_bad64, uint64_t, 0x7ff0000000000000u)

int record_check_finite(const struct record *rec, struct error *err)
{
    for (int i = 0; i < rec->count; i++) {
        const struct array *a = &rec->array[i];
        size_t n = array_count(a), at = n;

        if (a->dtype == DTYPE_F16)
            at = first_bad16(a->data, n);
        else if (a->dtype == DTYPE_F32)
            at = first_bad32(a->data, n);
        else if (a->dtype == DTYPE_F64)
            at = first_bad64(a->data, n);
        if (at < n)
            return error_set(err, EX_DATAERR, "%s %s[%zu] is not finite",
                             rec->type, a->name, at);
    }
    return 0;
}
