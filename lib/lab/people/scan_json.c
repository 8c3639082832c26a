/* A file parsed whole by cJSON, and its values by name; errors say which. */
#include "lib/lab/people/scan_json.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/file.h"

#define JSON_MAX ((size_t)16 << 20)

cJSON *scan_json_read(const char *path, struct error *err)
{
    char *text = file_read_text(path, JSON_MAX, err);
    cJSON *j;

    if (!text)
        return NULL;
    j = cJSON_Parse(text);
    free(text);
    if (!j)
        error_set(err, EX_DATAERR, "%s: cut or damaged (expected JSON)",
                  path);
    return j;
}

int scan_json_ints(int32_t *out, size_t n, int32_t limit, const cJSON *j,
                   const char *key, struct error *err)
{
    const cJSON *list = cJSON_GetObjectItemCaseSensitive(j, key), *e;
    size_t i = 0;

    if (!cJSON_IsArray(list) || (size_t)cJSON_GetArraySize(list) != n)
        return error_set(err, EX_DATAERR, "%s: expected a list of %zu "
                         "numbers", key, n);
    cJSON_ArrayForEach(e, list) {
        if (!cJSON_IsNumber(e) || e->valuedouble < 0
            || e->valuedouble >= limit)
            return error_set(err, EX_DATAERR, "%s: %zu is out of range "
                             "(expected 0 to %d)", key, i, limit - 1);
        out[i++] = (int32_t)e->valuedouble;
    }
    return 0;
}
