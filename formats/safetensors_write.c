/* safetensors files written: header, then the tensors in the order given, the
 * first of them on a 64-byte boundary. */
#include "formats/safetensors.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#include "formats/outfile.h"

/* The JSON header, for cJSON_free; offsets count from the first tensor. */
static char *st_describe_header(const struct st_tensor *tensors, size_t count,
                                const char *const *meta)
{
    cJSON *root = cJSON_CreateObject();
    size_t at = 0;

    if (meta && meta[0]) {
        cJSON *m = cJSON_AddObjectToObject(root, "__metadata__");

        for (; meta[0]; meta += 2)
            cJSON_AddStringToObject(m, meta[0], meta[1]);
    }
    for (size_t i = 0; i < count; i++) {
        const struct st_tensor *t = &tensors[i];
        size_t bytes = t->count * st_dtype_size(t->dtype);
        cJSON *j = cJSON_AddObjectToObject(root, t->name);

        cJSON_AddStringToObject(j, "dtype", st_dtype_name(t->dtype));
        cJSON *shape = cJSON_AddArrayToObject(j, "shape");
        for (int d = 0; d < t->ndim; d++)
            cJSON_AddItemToArray(shape,
                                 cJSON_CreateNumber((double)t->dim[d]));
        cJSON *offs = cJSON_AddArrayToObject(j, "data_offsets");
        cJSON_AddItemToArray(offs, cJSON_CreateNumber((double)at));
        cJSON_AddItemToArray(offs, cJSON_CreateNumber((double)(at + bytes)));
        at += bytes;
    }
    char *text = root ? cJSON_PrintUnformatted(root) : NULL;
    cJSON_Delete(root);
    return text;
}

/* What is saved, and where data that are not in memory come from. */
struct save {
    const struct st_tensor *tensors;
    size_t count;
    st_fetch fetch;
    void *context;
    bool unfetched;             /* fetch failed and has set *err */
};

/* Blanks after the JSON put the first tensor on a 64-byte boundary. */
static bool st_write_all(FILE *f, const char *json, struct save *s,
                         struct error *err)
{
    size_t len = strlen(json);
    uint64_t n = (len + 8 + 63) / 64 * 64 - 8;
    bool ok = fwrite(&n, 8, 1, f) == 1 && fwrite(json, 1, len, f) == len;

    for (size_t i = len; ok && i < n; i++)
        ok = putc(' ', f) != EOF;
    for (size_t i = 0; ok && i < s->count; i++) {
        const struct st_tensor *t = &s->tensors[i];
        size_t bytes = t->count * st_dtype_size(t->dtype);
        const void *data = t->data;

        if (!data && bytes && s->fetch)
            data = s->fetch(s->context, i, err);
        s->unfetched = !data && bytes;
        ok = !bytes || (data && fwrite(data, 1, bytes, f) == bytes);
    }
    return ok && !fflush(f);
}

int st_write(FILE *f, const struct st_tensor *tensors, size_t count,
             const char *const *meta, struct error *err)
{
    struct save save = {.tensors = tensors, .count = count};
    char *json = st_describe_header(tensors, count, meta);
    int rc = 0;

    if (!json)
        rc = error_set(err, EX_OSERR, "out of memory");
    else if (!st_write_all(f, json, &save, err))
        rc = error_set(err, EX_IOERR, "%s", strerror(errno));
    cJSON_free(json);
    return rc;
}

int st_save(const char *path, const struct st_tensor *tensors, size_t count,
            const char *const *meta, struct error *err)
{
    return st_save_from(path, tensors, count, meta, NULL, NULL, err);
}

int st_save_from(const char *path, const struct st_tensor *tensors,
                 size_t count, const char *const *meta, st_fetch fetch,
                 void *context, struct error *err)
{
    struct save save = {tensors, count, fetch, context, false};
    char *json = st_describe_header(tensors, count, meta);
    struct outfile out;
    int rc = -1;

    if (!json) {
        error_set(err, EX_OSERR, "%s: out of memory", path);
    } else if (outfile_open(&out, path, err) == 0) {
        /* a device or a pipe has nothing to sync (EINVAL) */
        if (st_write_all(out.file, json, &save, err) &&
            (!fsync(fileno(out.file)) || errno == EINVAL))
            rc = outfile_close(&out, err);
        else if (!save.unfetched)
            outfile_error(&out, err);
        outfile_abandon(&out);
    }
    cJSON_free(json);
    return rc;
}
