/* safetensors files read: mapped, checked before use, converted where asked. */
#include "formats/safetensors.h"

#include <cjson/cJSON.h>
#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sysexits.h>
#include <unistd.h>

#include "formats/arrayview.h"
#include "lib/base/file.h"
#include "lib/base/half.h"

#define HEADER_MAX ((uint64_t)64 << 20) /* bytes of JSON we agree to parse */

struct safetensors {
    char *path;
    void *map;
    size_t bytes;
    cJSON *json;            /* owns the names and the metadata */
    const cJSON *meta;
    struct st_tensor *tensor;
    const struct st_tensor **by_name;   /* (count) sorted */
    size_t count;
};

static const struct {
    const char *name;
    size_t size;
} dtypes[] = {
    [ST_U8] = {"U8", 1},     [ST_I8] = {"I8", 1},   [ST_I32] = {"I32", 4},
    [ST_I64] = {"I64", 8},   [ST_F16] = {"F16", 2}, [ST_BF16] = {"BF16", 2},
    [ST_F32] = {"F32", 4},   [ST_F64] = {"F64", 8}, [ST_BOOL] = {"BOOL", 1},
    [ST_I16] = {"I16", 2},   [ST_U16] = {"U16", 2}, [ST_U32] = {"U32", 4},
    [ST_U64] = {"U64", 8},
};
#define DTYPES (sizeof dtypes / sizeof *dtypes)

size_t st_dtype_size(enum st_dtype t)
{
    return dtypes[t].size;
}

const char *st_dtype_name(enum st_dtype t)
{
    return dtypes[t].name;
}

/* ---- opening: the file is hostile until every entry has been checked ---- */

/* A JSON number that is a whole number a size_t and a double both hold. */
static bool safetensors_json_size(const cJSON *j, size_t *out)
{
    if (!cJSON_IsNumber(j) || j->valuedouble < 0 ||
        j->valuedouble > 9007199254740991.0 ||
        j->valuedouble != floor(j->valuedouble))
        return false;
    *out = (size_t)j->valuedouble;
    return true;
}

/* Up to eight dimensions whose product does not overflow. */
static int safetensors_parse_shape(struct st_tensor *t, const cJSON *shape,
                                   const char *path, struct error *err)
{
    t->count = 1;
    for (const cJSON *d = shape->child; d; d = d->next) {
        size_t n;

        if (t->ndim == 8 || !safetensors_json_size(d, &n))
            return error_set(err, EX_DATAERR,
                             "%s: tensor '%s': bad shape (expected up to 8 "
                             "whole numbers)", path, t->name);
        if (n && t->count > SIZE_MAX / 16 / n)
            return error_set(err, EX_DATAERR,
                             "%s: tensor '%s': shape is too large", path,
                             t->name);
        t->dim[t->ndim++] = n;
        t->count *= n;
    }
    return 0;
}

/* By the file's name for it. */
static int safetensors_parse_dtype(struct st_tensor *t, const cJSON *dtype,
                                   const char *path, struct error *err)
{
    for (size_t i = 0; cJSON_IsString(dtype) && i < DTYPES; i++)
        if (!strcmp(dtype->valuestring, dtypes[i].name)) {
            t->dtype = (enum st_dtype)i;
            return 0;
        }
    return error_set(err, EX_DATAERR,
                     "%s: tensor '%s': dtype '%.20s' is not supported", path,
                     t->name, cJSON_IsString(dtype) ? dtype->valuestring : "");
}

/* One entry: dtype, shape and bytes agree and lie within the file. */
static int safetensors_parse_tensor(struct st_tensor *t, const cJSON *j,
                                    const char *data, size_t room,
                                    const char *path, struct error *err)
{
    const cJSON *shape = cJSON_GetObjectItemCaseSensitive(j, "shape");
    const cJSON *offs = cJSON_GetObjectItemCaseSensitive(j, "data_offsets");
    size_t from, to;

    t->name = j->string;
    if (safetensors_parse_dtype(t, cJSON_GetObjectItemCaseSensitive(j, "dtype"),
                                path, err))
        return -1;
    if (!cJSON_IsArray(shape) || !cJSON_IsArray(offs) ||
        cJSON_GetArraySize(offs) != 2 ||
        !safetensors_json_size(offs->child, &from) ||
        !safetensors_json_size(offs->child->next, &to))
        return error_set(err, EX_DATAERR,
                         "%s: tensor '%s': no shape or data_offsets", path,
                         t->name);
    if (safetensors_parse_shape(t, shape, path, err))
        return -1;
    if (from > to || to > room ||
        to - from != t->count * dtypes[t->dtype].size)
        return error_set(err, EX_DATAERR,
                         "%s: tensor '%s': offsets %zu to %zu do not fit "
                         "(expected %zu bytes inside %zu)", path, t->name,
                         from, to, t->count * dtypes[t->dtype].size, room);
    t->data = data + from;
    return 0;
}

/* For qsort: the order in the file. */
static int safetensors_by_place(const void *a, const void *b)
{
    const struct st_tensor *x = *(const struct st_tensor *const *)a;
    const struct st_tensor *y = *(const struct st_tensor *const *)b;

    return (x->data > y->data) - (x->data < y->data);
}

/* For qsort. */
static int safetensors_by_name(const void *a, const void *b)
{
    return strcmp((*(const struct st_tensor *const *)a)->name,
                  (*(const struct st_tensor *const *)b)->name);
}

/* For bsearch: of a name and an entry of by_name. */
static int safetensors_is_name(const void *name, const void *entry)
{
    return strcmp(name, (*(const struct st_tensor *const *)entry)->name);
}

/* The order of names, none of which may occur twice. */
static int safetensors_sort_names(struct safetensors *st, struct error *err)
{
    for (size_t i = 0; i < st->count; i++)
        st->by_name[i] = &st->tensor[i];
    qsort(st->by_name, st->count, sizeof *st->by_name, safetensors_by_name);
    for (size_t i = 1; i < st->count; i++)
        if (!strcmp(st->by_name[i - 1]->name, st->by_name[i]->name))
            return error_set(err, EX_DATAERR, "%s: tensor '%s' occurs twice",
                             st->path, st->by_name[i]->name);
    return 0;
}

/* Two tensors that share bytes are refused: no writer makes them. */
static int safetensors_check_overlap(const struct safetensors *st,
                                     struct error *err)
{
    const struct st_tensor **order =
        malloc((st->count + 1) * sizeof *order);
    int rc = 0;

    if (!order)
        return error_set(err, EX_OSERR, "%s: out of memory", st->path);
    size_t n = 0;
    for (size_t i = 0; i < st->count; i++)
        if (st->tensor[i].count)
            order[n++] = &st->tensor[i];
    qsort(order, n, sizeof *order, safetensors_by_place);
    for (size_t i = 1; i < n && !rc; i++) {
        const struct st_tensor *a = order[i - 1], *b = order[i];
        const char *end = (const char *)a->data +
                          a->count * dtypes[a->dtype].size;

        if (end > (const char *)b->data)
            rc = error_set(err, EX_DATAERR,
                           "%s: tensors '%s' and '%s' overlap", st->path,
                           a->name, b->name);
    }
    free(order);
    return rc;
}

/* A map of strings, or nothing. */
static int safetensors_parse_metadata(struct safetensors *st, struct error *err)
{
    const cJSON *m = cJSON_GetObjectItemCaseSensitive(st->json,
                                                      "__metadata__");

    if (m && !cJSON_IsObject(m))
        return error_set(err, EX_DATAERR, "%s: __metadata__ is not a map",
                         st->path);
    for (const cJSON *v = m ? m->child : NULL; v; v = v->next)
        if (!cJSON_IsString(v))
            return error_set(err, EX_DATAERR,
                             "%s: metadata '%s' is not a string", st->path,
                             v->string);
    st->meta = m;
    return 0;
}

/* All entries; no two overlap. */
static int safetensors_parse_header(struct safetensors *st, uint64_t n,
                                    struct error *err)
{
    const char *text = (const char *)st->map + 8;
    const char *data = text + n;
    size_t room = st->bytes - 8 - (size_t)n;

    st->json = cJSON_ParseWithLength(text, (size_t)n);
    if (!cJSON_IsObject(st->json))
        return error_set(err, EX_DATAERR,
                         "%s: header is not JSON (is this a safetensors "
                         "file?)", st->path);
    if (safetensors_parse_metadata(st, err))
        return -1;
    size_t entries = (size_t)cJSON_GetArraySize(st->json);
    st->tensor = calloc(entries + 1, sizeof *st->tensor);
    st->by_name = malloc((entries + 1) * sizeof *st->by_name);
    if (!st->tensor || !st->by_name)
        return error_set(err, EX_OSERR, "%s: out of memory", st->path);
    for (const cJSON *j = st->json->child; j; j = j->next) {
        if (!strcmp(j->string, "__metadata__"))
            continue;
        if (safetensors_parse_tensor(&st->tensor[st->count], j, data, room,
                                     st->path, err))
            return -1;
        st->count++;
    }
    return safetensors_sort_names(st, err) ||
                   safetensors_check_overlap(st, err) ? -1 : 0;
}

struct safetensors *st_open(const char *path, struct error *err)
{
    struct safetensors *st = calloc(1, sizeof *st);
    uint64_t n = 0;

    if (!st || !(st->path = strdup(path))) {
        error_set(err, EX_OSERR, "%s: out of memory", path);
        goto out;
    }
    st->map = file_map(&st->bytes, path, err);
    if (!st->map)
        goto out;
    if (st->bytes >= 8)
        memcpy(&n, st->map, 8);
    if (st->bytes < 8 || n > HEADER_MAX || n > st->bytes - 8) {
        error_set(err, EX_DATAERR,
                  "%s: header of %" PRIu64 " bytes in a file of %zu (is this "
                  "a safetensors file?)", path, n, st->bytes);
        goto out;
    }
    if (safetensors_parse_header(st, n, err))
        goto out;
    return st;
out:
    st_close(st);
    return NULL;
}

void st_close(struct safetensors *st)
{
    if (!st)
        return;
    if (st->map)
        munmap(st->map, st->bytes);
    cJSON_Delete(st->json);
    free(st->by_name);
    free(st->tensor);
    free(st->path);
    free(st);
}

/* ---- looking things up -------------------------------------------------- */

const char *st_path(const struct safetensors *st)
{
    return st->path;
}

size_t st_count(const struct safetensors *st)
{
    return st->count;
}

const struct st_tensor *st_at(const struct safetensors *st, size_t i)
{
    return i < st->count ? &st->tensor[i] : NULL;
}

const struct st_tensor *st_find(const struct safetensors *st,
                                const char *name)
{
    const struct st_tensor **at = bsearch(name, st->by_name, st->count,
                                          sizeof *st->by_name,
                                          safetensors_is_name);

    return at ? *at : NULL;
}

const char *st_meta(const struct safetensors *st, const char *key)
{
    const cJSON *v = cJSON_GetObjectItemCaseSensitive(st->meta, key);

    return v ? v->valuestring : NULL;
}

const char *st_meta_at(const struct safetensors *st, size_t i,
                       const char **value)
{
    const cJSON *item = st->meta ? cJSON_GetArrayItem(st->meta, (int)i) : NULL;

    if (!item)
        return NULL;
    *value = item->valuestring;
    return item->string;
}

/* "[3, 4]", with 0 printed as "any" where wanted. */
static const char *safetensors_shape_text(char *out, size_t size, int ndim,
                                          const size_t *dim, bool any)
{
    size_t n = (size_t)snprintf(out, size, "[");

    for (int i = 0; i < ndim && n < size; i++)
        n += any && !dim[i]
                 ? (size_t)snprintf(out + n, size - n, "%sany", i ? ", " : "")
                 : (size_t)snprintf(out + n, size - n, "%s%zu", i ? ", " : "",
                                    dim[i]);
    if (n < size)
        snprintf(out + n, size - n, "]");
    return out;
}

/* The tensor with this shape, or *err with what was found. */
static const struct st_tensor *
safetensors_tensor_require(const struct safetensors *st, const char *name,
                           int ndim, const size_t *dims, struct error *err)
{
    const struct st_tensor *t = st_find(st, name);
    char want[200], have[200];
    bool same = t && t->ndim == ndim;

    for (int i = 0; same && i < ndim; i++)
        same = !dims[i] || dims[i] == t->dim[i];
    if (same)
        return t;
    safetensors_shape_text(want, sizeof want, ndim, dims, true);
    if (!t)
        error_set(err, EX_DATAERR, "%s: no tensor '%s' (expected %s)",
                  st->path, name, want);
    else
        error_set(err, EX_DATAERR, "%s: tensor '%s' is %s (expected %s)",
                  st->path, name,
                  safetensors_shape_text(have, sizeof have, t->ndim, t->dim,
                                         false),
                  want);
    return NULL;
}

/* ---- converting --------------------------------------------------------- */

void st_forget(const struct safetensors *st, const void *from, size_t bytes)
{
    uintptr_t page = (uintptr_t)sysconf(_SC_PAGESIZE);
    uintptr_t map = (uintptr_t)st->map, first = (uintptr_t)from - map;
    uintptr_t end = (first + bytes) / page * page;

    if ((uintptr_t)from < map || first + bytes > st->bytes)
        return;                 /* a converted copy: not of this file */
    first = (first + page - 1) / page * page;
    /* the call costs more than a few pages are worth */
    if (first + 64 * page < end)
        madvise((char *)st->map + first, end - first, MADV_DONTNEED);
}

int st_to_f32(const struct safetensors *st, const struct st_tensor *t,
              float *out, struct error *err)
{
    const size_t run = 1 << 18, size = dtypes[t->dtype].size;

    for (size_t at = 0; at < t->count; at += run) {
        size_t end = t->count - at < run ? t->count : at + run;
        const char *from = (const char *)t->data + at * size;

        if (t->dtype == ST_F32)
            memcpy(out + at, from, (end - at) * sizeof *out);
        else if (t->dtype == ST_F16)        /* as models are kept */
            half_to_floats(out + at, from, end - at);
        else
            for (size_t i = at; i < end; i++)
                out[i] = (float)array_view_number(t->dtype, t->data, i);
        st_forget(st, (const char *)t->data + at * size, (end - at) * size);
        unsigned wrong = 0;
#pragma omp simd reduction(|:wrong)
        for (size_t i = at; i < end; i++)
            wrong |= !(fabsf(out[i]) <= FLT_MAX);
        for (size_t i = at; i < end && wrong; i++)
            if (!isfinite(out[i]))
                return error_set(err, EX_DATAERR, "%s: tensor '%s' is not "
                                 "finite at index %zu", st->path, t->name, i);
    }
    return 0;
}

int st_read_f32(float *out, const struct safetensors *st, const char *name,
                int ndim, const size_t *dims, struct error *err)
{
    const struct st_tensor *t = safetensors_tensor_require(st, name, ndim, dims,
                                                           err);

    return t ? st_to_f32(st, t, out, err) : -1;
}

float *st_load_f32(const struct safetensors *st, const char *name, int ndim,
                   const size_t *dims, size_t *count, struct error *err)
{
    const struct st_tensor *t = safetensors_tensor_require(st, name, ndim, dims,
                                                           err);
    float *out = t ? malloc((t->count + 1) * sizeof *out) : NULL;

    if (!t)
        return NULL;
    if (!out)
        return error_null(err, EX_OSERR, "%s: out of memory for '%s'",
                          st->path, name);
    if (st_to_f32(st, t, out, err)) {
        free(out);
        return NULL;
    }
    if (count)
        *count = t->count;
    return out;
}

const float *st_borrow_f32(const struct safetensors *st, const char *name,
                           int ndim, const size_t *dims, float **copy,
                           struct error *err)
{
    const struct st_tensor *t = safetensors_tensor_require(st, name, ndim, dims,
                                                           err);

    *copy = NULL;
    if (!t)
        return NULL;
    if (t->dtype == ST_F32 && (uintptr_t)t->data % sizeof(float) == 0)
        return t->data;
    return *copy = st_load_f32(st, name, ndim, dims, NULL, err);
}

const void *st_borrow_f16(const struct safetensors *st, const char *name,
                          int ndim, const size_t *dims, size_t *count,
                          struct error *err)
{
    const struct st_tensor *t = safetensors_tensor_require(st, name, ndim, dims,
                                                           err);

    if (!t)
        return NULL;
    *count = t->count;
    if (t->dtype == ST_F16)
        return t->data;
    return error_null(err, EX_DATAERR, "%s: tensor '%s' is of %s (expected "
                      "F16)", st->path, name, st_dtype_name(t->dtype));
}

int32_t *st_load_i32(const struct safetensors *st, const char *name, int ndim,
                     const size_t *dims, size_t *count, struct error *err)
{
    const struct st_tensor *t = safetensors_tensor_require(st, name, ndim, dims,
                                                           err);

    if (!t)
        return NULL;
    if (t->dtype >= ST_F16 && t->dtype <= ST_F64)
        return error_null(err, EX_DATAERR, "%s: tensor '%s' is %s (expected "
                          "I32)", st->path, name, dtypes[t->dtype].name);
    int32_t *out = malloc((t->count + 1) * sizeof *out);
    if (!out)
        return error_null(err, EX_OSERR, "%s: out of memory for '%s'",
                          st->path, name);
    for (size_t i = 0; i < t->count; i++) {
        double v = array_view_number(t->dtype, t->data, i);

        if (v < INT32_MIN || v > INT32_MAX) {
            error_set(err, EX_DATAERR,
                      "%s: tensor '%s' at index %zu is %.0f (expected a "
                      "32-bit number)", st->path, name, i, v);
            free(out);
            return NULL;
        }
        out[i] = (int32_t)v;
    }
    if (count)
        *count = t->count;
    return out;
}
