/* Reading mediapipe_to_ict.json. */
#include "lib/lab/people/landmark_map.h"

#include <sysexits.h>

#include "formats/jsonfile.h"
#include "lib/lab/head/scan.h"

#define MAP_MAX ((size_t)16 << 20)

/* out (468) = the list `key` of numbers from 0 up to below `end`. */
static int landmark_map_list(double out[LANDMARK_FACE], int end,
                             const cJSON *j, const char *key,
                             struct error *err)
{
    const cJSON *list = cJSON_GetObjectItemCaseSensitive(j, key), *e;
    size_t i = 0;

    if (!cJSON_IsArray(list) || cJSON_GetArraySize(list) != LANDMARK_FACE)
        return error_set(err, EX_DATAERR, "%s: expected a list of %d numbers",
                         key, LANDMARK_FACE);
    cJSON_ArrayForEach(e, list) {
        if (!cJSON_IsNumber(e) ||
            !(e->valuedouble >= 0 && e->valuedouble < end))
            return error_set(err, EX_DATAERR, "%s: number %zu is out of range "
                             "(expected less than %d)", key, i, end);
        out[i++] = e->valuedouble;
    }
    return 0;
}

int landmark_map_read(struct landmark_map *m, const char *path,
                      struct error *err)
{
    double landmark[LANDMARK_FACE], vertex[LANDMARK_FACE];
    double spread[LANDMARK_FACE];       /* centimetres */
    int seen[LANDMARK_FACE] = {0}, rc;
    cJSON *j = jsonfile_read(path, MAP_MAX, err);

    if (!j)
        return -1;
    rc = landmark_map_list(landmark, LANDMARK_FACE, j, "landmark", err) ||
         landmark_map_list(vertex, SCAN_VERTS, j, "vertex", err) ||
         landmark_map_list(spread, 100, j, "spread_cm", err) ? -1 : 0;
    for (int i = 0; !rc && i < LANDMARK_FACE; i++) {
        const int k = (int)landmark[i];

        if (seen[k]++)
            rc = error_set(err, EX_DATAERR, "landmark: %d is there twice "
                           "(expected each once)", k);
        m->vertex[k] = (int32_t)vertex[i];
        m->spread[k] = spread[i];
    }
    cJSON_Delete(j);
    return rc ? error_prefix(err, "%s", path) : 0;
}
