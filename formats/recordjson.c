/* Records as lines of JSON, and back. */
#include "formats/recordjson.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/file.h"
#include "lib/base/half.h"
#include "lib/stream/schema.h"
#include "lib/stream/stats.h"

/* ---- writing ---------------------------------------------------------- */

/* Escaped; control characters as \u00XX. */
static void recordjson_put_string(FILE *f, const char *s, size_t n)
{
    putc('"', f);
    for (size_t i = 0; i < n; i++) {
        unsigned char c = (unsigned char)s[i];

        if (c == '"' || c == '\\')
            fprintf(f, "\\%c", c);
        else if (c < ' ')
            fprintf(f, "\\u%04x", c);
        else
            putc(c, f);
    }
    putc('"', f);
}

/* Digits enough to get the same value back. */
static void recordjson_put_number(FILE *f, double v, enum dtype dtype)
{
    if (isnan(v))
        fputs("\"nan\"", f);
    else if (isinf(v))
        fputs(v > 0 ? "\"inf\"" : "\"-inf\"", f);
    else
        fprintf(f, "%.*g", dtype == DTYPE_F64 ? 17 : dtype == DTYPE_F16 ? 5
                : dtype == DTYPE_F32 ? 9 : 10, v);
}

/* null for what does not exist. */
static void recordjson_put_statistic(FILE *f, const char *key, double v)
{
    if (isnan(v))
        fprintf(f, ",\"%s\":null", key);
    else
        fprintf(f, ",\"%s\":%.9g", key, v);
}

/* Bytes that a JSON string can carry: UTF-8 starts and continuations are
 * taken on trust, NUL is not. */
static bool recordjson_is_text(const struct array *a)
{
    const char *s = a->data;
    size_t n = array_count(a);

    return a->dtype == DTYPE_U8 && a->ndim == 1 &&
           strcmp(a->name, "json") == 0 && !memchr(s, 0, n);
}

/* Name, dtype, shape, statistics and, if asked for, every value. */
static void recordjson_put_array(FILE *f, const struct array *a, bool values)
{
    struct array_stats s;
    size_t n = array_count(a);

    fputs("{\"name\":", f);
    recordjson_put_string(f, a->name, strlen(a->name));
    fprintf(f, ",\"dtype\":\"%s\",\"shape\":[", dtype_name(a->dtype));
    for (int k = 0; k < a->ndim; k++)
        fprintf(f, "%s%zu", k ? "," : "", a->dim[k]);
    putc(']', f);
    array_stats(&s, a);
    recordjson_put_statistic(f, "min", s.min);
    recordjson_put_statistic(f, "mean", s.mean);
    recordjson_put_statistic(f, "max", s.max);
    fprintf(f, ",\"nonfinite\":%zu", s.nonfinite);
    if (recordjson_is_text(a)) {
        fputs(",\"text\":", f);
        recordjson_put_string(f, a->data, n);
    } else if (values) {
        fputs(",\"data\":[", f);
        for (size_t i = 0; i < n; i++) {
            if (i)
                putc(',', f);
            recordjson_put_number(f, array_value(a, i), a->dtype);
        }
        putc(']', f);
    }
    putc('}', f);
}

void recordjson_write(FILE *f, const struct record *rec, bool values)
{
    fputs("{\"type\":", f);
    recordjson_put_string(f, rec->type, 4);
    fprintf(f, ",\"frame\":%llu,\"time\":%.17g,\"arrays\":[",
            (unsigned long long)rec->frame, rec->time);
    for (int i = 0; i < rec->count; i++) {
        if (i)
            putc(',', f);
        recordjson_put_array(f, &rec->array[i], values);
    }
    fputs("]}\n", f);
}

/* ---- reading ---------------------------------------------------------- */

/* Frames counted per type, for records that give none. */
struct counter {
    char type[5];
    uint64_t next;
};

struct json_reader {
    double fps;
    struct counter counter[32];
    int counters;
    void *data[STREAM_MAX_ARRAYS]; /* of the record being made */
};

/* As given, or the first that spid-stream(5) names, or f32. */
static int recordjson_get_dtype(enum dtype *dtype, const char *type,
                                const char *name, const cJSON *given,
                                struct error *err)
{
    const struct schema *s = schema_find(type, name);
    const char *text = cJSON_GetStringValue(given);

    *dtype = DTYPE_F32;
    if (!text && s && strstr(s->dtypes, "f32"))
        return 0;
    for (int t = DTYPE_U8; t <= DTYPE_F64; t++) {
        const char *known = dtype_name((enum dtype)t);

        if (text ? strcmp(text, known) == 0
                 : s && strncmp(s->dtypes, known, strlen(known)) == 0) {
            *dtype = (enum dtype)t;
            return 0;
        }
    }
    if (text)
        return error_set(err, EX_DATAERR, "%s %s: dtype '%.20s' (expected u8, "
                         "i32, f16, f32 or f64)", type, name, text);
    return 0;
}

/* One number, in the array's range; words for what JSON cannot say. */
static int recordjson_put_value(const struct array *a, void *data, size_t i,
                                const cJSON *item, struct error *err)
{
    const char *text = cJSON_GetStringValue(item);
    double v = item->valuedouble;
    double lo = a->dtype == DTYPE_U8 ? 0 : INT32_MIN;
    double hi = a->dtype == DTYPE_U8 ? 255 : INT32_MAX;

    if (text && strcmp(text, "nan") == 0)
        v = NAN;
    else if (text && (strcmp(text, "inf") == 0 || strcmp(text, "-inf") == 0))
        v = *text == '-' ? -INFINITY : INFINITY;
    else if (!cJSON_IsNumber(item))
        return error_set(err, EX_DATAERR, "%s[%zu] is not a number", a->name,
                         i);
    switch (a->dtype) {
    case DTYPE_U8:
    case DTYPE_I32:
        if (!(v >= lo && v <= hi) || v != floor(v))
            return error_set(err, EX_DATAERR, "%s[%zu] is %g (expected a "
                             "whole number, %.0f to %.0f)", a->name, i, v, lo,
                             hi);
        if (a->dtype == DTYPE_U8)
            ((uint8_t *)data)[i] = (uint8_t)v;
        else
            ((int32_t *)data)[i] = (int32_t)v;
        break;
    case DTYPE_F16:
        ((uint16_t *)data)[i] = float_to_half((float)v);
        break;
    case DTYPE_F32:
        ((float *)data)[i] = (float)v;
        break;
    case DTYPE_F64:
        ((double *)data)[i] = v;
        break;
    }
    return 0;
}

/* Leaves of nested lists in order; every list at one depth has the same
 * length. */
static int recordjson_put_nested(const struct array *a, void *data, size_t *i,
                                 const cJSON *item, int depth,
                                 struct error *err)
{
    if (depth == a->ndim)
        return recordjson_put_value(a, data, (*i)++, item, err);
    if (!cJSON_IsArray(item) ||
        (size_t)cJSON_GetArraySize(item) != a->dim[depth])
        return error_set(err, EX_DATAERR, "%s is ragged (expected lists of "
                         "%zu)", a->name, a->dim[depth]);
    for (const cJSON *c = item->child; c; c = c->next)
        if (recordjson_put_nested(a, data, i, c, depth + 1, err))
            return -1;
    return 0;
}

/* A string as u8. */
static void *recordjson_text_data(struct array *a, const char *text)
{
    size_t n = strlen(text);
    char *data = malloc(n + 1);

    a->dtype = DTYPE_U8;
    a->ndim = 1;
    a->dim[0] = n;
    return data ? memcpy(data, text, n + 1) : NULL;
}

/* The shape of nested lists: the lengths of the first ones. */
static int recordjson_nested_shape(struct array *a, const cJSON *item)
{
    for (; cJSON_IsArray(item); item = item->child) {
        if (a->ndim == 4)
            return -1;
        a->dim[a->ndim++] = (size_t)cJSON_GetArraySize(item);
        if (!item->child)
            break;
    }
    return 0;
}

/* Shape and data from nested lists. */
static int recordjson_nested_array(struct array *a, void **data,
                                   const cJSON *value, struct error *err)
{
    size_t i = 0;

    if (cJSON_IsString(value)) {
        *data = recordjson_text_data(a, value->valuestring);
        return *data ? 0 : error_set(err, EX_OSERR, "out of memory");
    }
    if (recordjson_nested_shape(a, value))
        return error_set(err, EX_DATAERR, "%s has more than 4 dimensions",
                         a->name);
    *data = calloc(array_count(a) + 1, dtype_size(a->dtype));
    if (!*data)
        return error_set(err, EX_OSERR, "out of memory");
    return recordjson_put_nested(a, *data, &i, value, 0, err);
}

/* {"name","dtype","shape","data" or "text"}. */
static int recordjson_flat_array(struct array *a, void **data, const cJSON *j,
                                 struct error *err)
{
    const cJSON *values = cJSON_GetObjectItemCaseSensitive(j, "data");
    const cJSON *shape = cJSON_GetObjectItemCaseSensitive(j, "shape");
    const cJSON *text = cJSON_GetObjectItemCaseSensitive(j, "text");
    size_t i = 0, n, listed;

    if (!values && cJSON_IsString(text))
        return recordjson_nested_array(a, data, text, err);
    if (!cJSON_IsArray(values) || !cJSON_IsArray(shape) ||
        cJSON_GetArraySize(shape) > 4)
        return error_set(err, EX_DATAERR, "%s has no shape and data (write "
                         "them with spid-dump --json --values)", a->name);
    listed = (size_t)cJSON_GetArraySize(values);
    for (const cJSON *d = shape->child; d; d = d->next) {
        double v = cJSON_IsNumber(d) ? d->valuedouble : -1;

        if (!(v >= 0 && v <= 4294967295.0) || v != floor(v))
            return error_set(err, EX_DATAERR, "%s has a bad shape", a->name);
        a->dim[a->ndim++] = (size_t)v;
    }
    n = 1;
    for (int k = 0; k < a->ndim; k++)
        if (__builtin_mul_overflow(n, a->dim[k], &n))
            n = SIZE_MAX;
    if (n != listed)
        return error_set(err, EX_DATAERR, "%s lists %zu values (expected "
                         "%zu)", a->name, listed, n);
    *data = calloc(n + 1, dtype_size(a->dtype));
    if (!*data)
        return error_set(err, EX_OSERR, "out of memory");
    for (const cJSON *c = values->child; c; c = c->next)
        if (recordjson_put_value(a, *data, i++, c, err))
            return -1;
    return 0;
}

/* Of either form; data is for the caller to free. */
static int recordjson_get_array(struct record *rec, void **data, const cJSON *j,
                                bool nested, struct error *err)
{
    struct array *a = &rec->array[rec->count];
    const char *name = nested ? j->string
                              : cJSON_GetStringValue(
                                    cJSON_GetObjectItem(j, "name"));

    memset(a, 0, sizeof *a);
    if (!name || !*name || strlen(name) >= STREAM_NAME)
        return error_set(err, EX_DATAERR, "array '%.40s' has no valid name "
                         "(expected 1 to %d letters)", name ? name : "",
                         STREAM_NAME - 1);
    strcpy(a->name, name);
    if (recordjson_get_dtype(&a->dtype, rec->type, name,
                             nested ? NULL : cJSON_GetObjectItem(j, "dtype"),
                             err))
        return -1;
    if (nested ? recordjson_nested_array(a, data, j, err)
               : recordjson_flat_array(a, data, j, err))
        return -1;
    a->data = *data;
    rec->count++;
    return 0;
}

/* Frame and time, given or counted. */
static int recordjson_get_place(struct json_reader *r, struct record *rec,
                                const cJSON *j, struct error *err)
{
    const cJSON *frame = cJSON_GetObjectItemCaseSensitive(j, "frame");
    const cJSON *time = cJSON_GetObjectItemCaseSensitive(j, "time");
    struct counter *c = r->counter;

    while (c < r->counter + r->counters && strcmp(c->type, rec->type))
        c++;
    if (c == r->counter + r->counters && r->counters < 32) {
        r->counters++;
        strcpy(c->type, rec->type);
    } else if (c == r->counter + r->counters) {
        c = r->counter; /* more types than anyone uses share a counter */
    }
    rec->frame = c->next;
    if (frame) {
        double v = cJSON_IsNumber(frame) ? frame->valuedouble : -1;

        if (!(v >= 0 && v <= 9007199254740992.0) || v != floor(v))
            return error_set(err, EX_DATAERR, "frame is not a whole number");
        rec->frame = (uint64_t)v;
    }
    c->next = rec->frame + 1;
    rec->time = (double)rec->frame / r->fps;
    if (time && (!cJSON_IsNumber(time) || !isfinite(time->valuedouble)))
        return error_set(err, EX_DATAERR, "time is not a number");
    if (time)
        rec->time = time->valuedouble;
    return 0;
}

/* One object to the sink. */
static int recordjson_get_record(struct json_reader *r, const cJSON *j,
                                 record_sink sink, void *context,
                                 struct error *err)
{
    const char *type = cJSON_GetStringValue(cJSON_GetObjectItem(j, "type"));
    const cJSON *arrays = cJSON_GetObjectItemCaseSensitive(j, "arrays");
    struct record rec = { 0 };
    int rc = -1;

    if (!type || strlen(type) != 4)
        return error_set(err, EX_DATAERR, "a record without a type of four "
                         "letters");
    strcpy(rec.type, type);
    if (recordjson_get_place(r, &rec, j, err))
        return error_prefix(err, "%s", type);
    memset(r->data, 0, sizeof r->data);
    for (const cJSON *a = arrays ? arrays->child : NULL; a; a = a->next) {
        if (rec.count == STREAM_MAX_ARRAYS) {
            error_set(err, EX_DATAERR, "more than %d arrays",
                      STREAM_MAX_ARRAYS);
            goto out;
        }
        if (recordjson_get_array(&rec, &r->data[rec.count], a,
                                 cJSON_IsObject(arrays), err))
            goto out;
    }
    rc = sink(&rec, context, err);
out:
    for (int i = 0; i < STREAM_MAX_ARRAYS; i++)
        free(r->data[i]);
    return rc ? error_prefix(err, "frame %llu: %s",
                             (unsigned long long)rec.frame, type) : 0;
}

/* For messages. */
static int recordjson_line_of(const char *text, const char *at)
{
    int line = 1;

    for (; text < at && *text; text++)
        line += *text == '\n';
    return line;
}

/* One object or list after the other. */
static int recordjson_read_values(struct json_reader *r, const char *text,
                                  record_sink sink, void *context,
                                  struct error *err)
{
    const char *p = text + strspn(text, " \t\r\n"), *end = p;
    cJSON *j;
    int rc = 0;

    while (rc == 0 && *p) {
        j = cJSON_ParseWithOpts(p, &end, 0);
        if (!j)
            return error_set(err, EX_DATAERR, "line %d: not JSON",
                             recordjson_line_of(text, end));
        if (cJSON_IsArray(j)) {
            for (const cJSON *c = j->child; c && rc == 0; c = c->next)
                rc = recordjson_get_record(r, c, sink, context, err);
        } else {
            rc = recordjson_get_record(r, j, sink, context, err);
        }
        cJSON_Delete(j);
        if (rc)
            return error_prefix(err, "line %d", recordjson_line_of(text, p));
        p = end + strspn(end, " \t\r\n");
    }
    return rc;
}

int recordjson_read(const char *path, double fps, size_t max_bytes,
                    record_sink sink, void *context, struct error *err)
{
    struct json_reader r = { .fps = fps };
    char *text = file_read_text(path, max_bytes, err);

    if (!text)
        return -1;
    int rc = recordjson_read_values(&r, text, sink, context, err);
    free(text);
    return rc ? error_prefix(err, "%s", path) : 0;
}
