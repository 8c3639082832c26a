/* The reading half of formats/recordfile.h. */
#include "formats/recordfile.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/jsonfile.h"
#include "formats/npy.h"
#include "formats/safetensors.h"
#include "lib/base/list.h"

#define PATH_ROOM 4096
#define MAX_FILES 4096
#define INDEX_MAX ((size_t)1 << 30)     /* bytes of records.json */

/* Type, frame and time of an index row. */
static int recordload_get_head(struct record *rec, const cJSON *row,
                               struct error *err)
{
    const char *type = cJSON_GetStringValue(cJSON_GetObjectItem(row, "type"));
    const cJSON *frame = cJSON_GetObjectItem(row, "frame");
    const cJSON *time = cJSON_GetObjectItem(row, "time");

    if (!type || strlen(type) != 4 || !cJSON_IsNumber(frame) ||
        !(frame->valuedouble >= 0 && frame->valuedouble < 9007199254740992.0)
        || !cJSON_IsNumber(time) || !isfinite(time->valuedouble))
        return error_set(err, EX_DATAERR, "bad record list (expected type, "
                         "frame and time)");
    memset(rec, 0, sizeof *rec);
    strcpy(rec->type, type);
    rec->frame = (uint64_t)frame->valuedouble;
    rec->time = time->valuedouble;
    return 0;
}

/* Next free array of rec under that name. */
static struct array *recordload_next_array(struct record *rec, const char *name,
                                           struct error *err)
{
    struct array *a = &rec->array[rec->count];

    if (rec->count == STREAM_MAX_ARRAYS || !name || !*name ||
        strlen(name) >= STREAM_NAME)
        return error_null(err, EX_DATAERR, "bad record list (expected up to "
                          "%d arrays of 1 to %d letters)", STREAM_MAX_ARRAYS,
                          STREAM_NAME - 1);
    memset(a, 0, sizeof *a);
    strcpy(a->name, name);
    rec->count++;
    return a;
}

/* ---- safetensors -------------------------------------------------------- */

/* A tensor by name, tried first where the writer put it. */
static const struct st_tensor *
recordload_tensor_find(const struct safetensors *st, const char *name,
                       size_t *next)
{
    size_t i = (*next)++;

    if (i < st_count(st) && strcmp(st_at(st, i)->name, name) == 0)
        return st_at(st, i);
    return st_find(st, name);
}

/* One array of a record: its tensor, checked against the index. */
static int recordload_st_array(struct record *rec, const struct safetensors *st,
                               size_t number, const char *name, size_t *next,
                               struct error *err)
{
    struct array *a = recordload_next_array(rec, name, err);
    const struct st_tensor *t;
    char full[64];

    if (!a)
        return -1;
    snprintf(full, sizeof full, "%06zu.%s.%s", number, rec->type, name);
    t = recordload_tensor_find(st, full, next);
    if (!t)
        return error_set(err, EX_DATAERR, "no tensor '%s'", full);
    switch (t->dtype) {
    case ST_U8:  a->dtype = DTYPE_U8; break;
    case ST_I32: a->dtype = DTYPE_I32; break;
    case ST_F16: a->dtype = DTYPE_F16; break;
    case ST_F32: a->dtype = DTYPE_F32; break;
    case ST_F64: a->dtype = DTYPE_F64; break;
    default:
        return error_set(err, EX_DATAERR, "tensor '%s' is %s (expected U8, "
                         "I32, F16, F32 or F64)", full,
                         st_dtype_name(t->dtype));
    }
    if (t->ndim > 4)
        return error_set(err, EX_DATAERR, "tensor '%s' has %d dimensions "
                         "(expected 0 to 4)", full, t->ndim);
    a->ndim = t->ndim;
    for (int k = 0; k < t->ndim; k++)
        a->dim[k] = t->dim[k];
    a->data = t->data;
    return 0;
}

/* One row of the index to the sink. */
static int recordload_st_record(const struct safetensors *st, size_t number,
                                const cJSON *row, size_t *next,
                                record_sink sink, void *context,
                                struct error *err)
{
    const cJSON *names = cJSON_GetObjectItem(row, "arrays");
    struct record rec;

    if (recordload_get_head(&rec, row, err))
        return -1;
    for (const cJSON *n = names ? names->child : NULL; n; n = n->next)
        if (recordload_st_array(&rec, st, number, cJSON_GetStringValue(n), next,
                                err))
            return -1;
    return sink(&rec, context, err);
}

int recordfile_read_st(const char *path, record_sink sink, void *context,
                       struct error *err)
{
    struct safetensors *st = st_open(path, err);
    const char *text = st ? st_meta(st, "spid.records") : NULL;
    cJSON *index = text ? cJSON_Parse(text) : NULL;
    size_t number = 0, next = 0;
    int rc = 0;

    if (!st)
        return -1;
    if (!cJSON_IsArray(index))
        rc = error_set(err, EX_DATAERR, "no list of records in its metadata");
    for (const cJSON *row = index ? index->child : NULL; row && rc == 0;
         row = row->next)
        rc = recordload_st_record(st, number++, row, &next, sink, context, err);
    cJSON_Delete(index);
    st_close(st);
    return rc ? error_prefix(err, "%s", path) : 0;
}

/* ---- npy directories ---------------------------------------------------- */

/* Files read so far, each once and whole. */
struct cache {
    const char *dir;
    struct loaded {
        char *file;
        struct npy a;
    } *loaded;
    size_t count, room;
};

/* The file, read at its first use. */
static const struct npy *recordload_cache_get(struct cache *c, const char *file,
                                              struct error *err)
{
    char path[PATH_ROOM];
    struct loaded *l;

    for (size_t i = 0; i < c->count; i++)
        if (strcmp(c->loaded[i].file, file) == 0)
            return &c->loaded[i].a;
    if (strchr(file, '/') || c->count == MAX_FILES)
        return error_null(err, EX_DATAERR, "bad file name '%.80s'", file);
    l = list_add(&c->loaded, &c->count, &c->room, sizeof *l, err);
    if (!l)
        return NULL;
    snprintf(path, sizeof path, "%s/%s", c->dir, file);
    l->file = strdup(file);
    if (l->file && npy_load(&l->a, path, err) == 0)
        return &l->a;
    free(l->file);
    c->count--;
    return NULL;
}

/* Every file read. */
static void recordload_cache_release(struct cache *c)
{
    for (size_t i = 0; i < c->count; i++) {
        free(c->loaded[i].file);
        npy_release(&c->loaded[i].a);
    }
    free(c->loaded);
}

/* One array of a record: a row of its column. */
static int recordload_npy_array(struct record *rec, struct cache *c,
                                const cJSON *item, struct error *err)
{
    struct array *a = recordload_next_array(rec, item->string, err);
    const cJSON *number = cJSON_GetArrayItem(item, 1);
    const char *file = cJSON_GetStringValue(cJSON_GetArrayItem(item, 0));
    const struct npy *n;
    double row;

    if (!a)
        return -1;
    if (!file || !cJSON_IsNumber(number))
        return error_set(err, EX_DATAERR, "%s: expected [file, row]",
                         item->string);
    if (!(n = recordload_cache_get(c, file, err)))
        return -1;
    row = number->valuedouble;
    if (n->ndim < 1 || !(row >= 0 && row < (double)n->dim[0]))
        return error_set(err, EX_DATAERR, "%s: no row %.0f", file, row);
    a->dtype = n->dtype;
    a->ndim = n->ndim - 1;
    for (int k = 0; k < a->ndim; k++)
        a->dim[k] = n->dim[k + 1];
    a->data = (const char *)n->data + (size_t)row * array_bytes(a);
    return 0;
}

/* One row of the index to the sink. */
static int recordload_npy_record(struct cache *c, const cJSON *row,
                                 record_sink sink, void *context,
                                 struct error *err)
{
    const cJSON *arrays = cJSON_GetObjectItem(row, "arrays");
    struct record rec;

    if (recordload_get_head(&rec, row, err))
        return -1;
    for (const cJSON *a = arrays ? arrays->child : NULL; a; a = a->next)
        if (recordload_npy_array(&rec, c, a, err))
            return -1;
    return sink(&rec, context, err);
}

/* The JSON text of records.json. */
static cJSON *recordload_read_index(const char *path, struct error *err)
{
    cJSON *index = jsonfile_read(path, INDEX_MAX, err);

    if (!index || cJSON_IsArray(index))
        return index;
    cJSON_Delete(index);
    return error_null(err, EX_DATAERR, "%s: not a list of records", path);
}

int recordfile_read_npy(const char *dir, record_sink sink, void *context,
                        struct error *err)
{
    struct cache c = { .dir = dir };
    char path[PATH_ROOM];
    cJSON *index;
    int rc = 0;

    snprintf(path, sizeof path, "%s/records.json", dir);
    index = recordload_read_index(path, err);
    if (!index)
        return -1;
    for (const cJSON *row = index->child; row && rc == 0; row = row->next)
        rc = recordload_npy_record(&c, row, sink, context, err);
    cJSON_Delete(index);
    recordload_cache_release(&c);
    return rc ? error_prefix(err, "%s", dir) : 0;
}
