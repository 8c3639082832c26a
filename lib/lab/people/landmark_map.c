/* Reading mediapipe_to_ict.json. */
#include "lib/lab/people/landmark_map.h"

#include <sysexits.h>

#include "lib/lab/head/scan.h"
#include "lib/lab/people/scan_json.h"

/* spread (468) by landmark from the list of numbers. */
static int landmark_map_spreads(double *spread, const int32_t *landmark,
                                const cJSON *j, struct error *err)
{
    const cJSON *list = cJSON_GetObjectItemCaseSensitive(j, "spread_cm"), *e;
    size_t i = 0;

    if (!cJSON_IsArray(list) || cJSON_GetArraySize(list) != LANDMARK_FACE)
        return error_set(err, EX_DATAERR, "spread_cm: expected a list of %d "
                         "numbers", LANDMARK_FACE);
    cJSON_ArrayForEach(e, list) {
        if (!cJSON_IsNumber(e) ||
            !(e->valuedouble >= 0 && e->valuedouble < 100))
            return error_set(err, EX_DATAERR, "spread_cm: %zu is no distance "
                             "(expected 0 to 100)", i);
        spread[landmark[i++]] = e->valuedouble;
    }
    return 0;
}

int landmark_map_read(struct landmark_map *m, const char *path,
                      struct error *err)
{
    int32_t landmark[LANDMARK_FACE], vertex[LANDMARK_FACE];
    int seen[LANDMARK_FACE] = {0}, rc;
    cJSON *j = scan_json_read(path, err);

    if (!j)
        return -1;
    rc = scan_json_ints(landmark, LANDMARK_FACE, LANDMARK_FACE, j, "landmark",
                        err) ||
         scan_json_ints(vertex, LANDMARK_FACE, SCAN_VERTS, j, "vertex", err) ||
         landmark_map_spreads(m->spread, landmark, j, err) ? -1 : 0;
    for (int i = 0; !rc && i < LANDMARK_FACE; i++) {
        if (seen[landmark[i]]++)
            rc = error_set(err, EX_DATAERR, "landmark: %d is there twice "
                           "(expected each once)", landmark[i]);
        m->vertex[landmark[i]] = vertex[i];
    }
    cJSON_Delete(j);
    return rc ? error_prefix(err, "%s", path) : 0;
}
