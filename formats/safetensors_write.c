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

#include "lib/base/file.h"

/* The JSON header; offsets count from the first tensor. */
static cJSON *st_describe_header(const struct st_tensor *tensors,
                                 size_t count, const char *const *meta)
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
    return root;
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

/* A device or a pipe has nothing to sync (EINVAL). */
static bool st_write_sync(FILE *f)
{
    return !fsync(fileno(f)) || errno == EINVAL;
}

int st_write(FILE *f, const struct st_tensor *tensors, size_t count,
             const char *const *meta, struct error *err)
{
    struct save save = {.tensors = tensors, .count = count};
    cJSON *root = st_describe_header(tensors, count, meta);
    char *json = root ? cJSON_PrintUnformatted(root) : NULL;
    int rc = 0;

    if (!json)
        rc = error_set(err, EX_OSERR, "out of memory");
    else if (!st_write_all(f, json, &save, err))
        rc = error_set(err, EX_IOERR, "%s", strerror(errno));
    cJSON_Delete(root);
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
    size_t len = strlen(path) + 6;
    char *part = malloc(len), *json = NULL;
    cJSON *root = st_describe_header(tensors, count, meta);
    FILE *f = NULL;
    int rc = -1;

    if (!part || !root || !(json = cJSON_PrintUnformatted(root))) {
        error_set(err, EX_OSERR, "%s: out of memory", path);
        goto out;
    }
    bool special = file_is_special(path); /* written in place */
    snprintf(part, len, "%s%s", path, special ? "" : ".part");
    f = fopen(part, "wb");
    if (!f) {
        error_set(err, EX_CANTCREAT, "%s: %s", part, strerror(errno));
        goto out;
    }
    bool ok = st_write_all(f, json, &save, err) && st_write_sync(f);
    int why = errno;
    ok = !fclose(f) && ok;
    if (!ok || (!special && file_rename(part, path))) {
        if (!save.unfetched)
            error_set(err, EX_IOERR, "%s: %s", path,
                      strerror(ok ? errno : why));
        if (!special)
            remove(part);
        goto out;
    }
    rc = 0;
out:
    cJSON_Delete(root);
    cJSON_free(json);
    free(part);
    return rc;
}
