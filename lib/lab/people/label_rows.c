/* Reading a file of labelled pictures (label_rows.h). */
#include "lib/lab/people/label_rows.h"

#include <cjson/cJSON.h>
#include <stdbool.h>
#include <sysexits.h>

#include "formats/safetensors.h"

/* A metadata list of n strings, in r's memory; NULL and *err. */
static const char **label_list(struct label_rows *r, const struct safetensors *st,
                               const char *key, size_t n, struct error *err)
{
    const char *text = st_meta(st, key);
    cJSON *list = text ? cJSON_Parse(text) : NULL, *e;
    const char **to = arena_take(&r->memory, n, sizeof *to);
    bool good = cJSON_IsArray(list) && (size_t)cJSON_GetArraySize(list) == n;
    size_t i = 0;

    cJSON_ArrayForEach(e, list)
        good = good && cJSON_IsString(e);
    if (!good)
        error_set(err, EX_DATAERR, "%s: metadata %s: expected a JSON list of "
                  "%zu names", st_path(st), key, n);
    else
        good = arena_check(&r->memory, "names", err) == 0;
    if (good)
        cJSON_ArrayForEach(e, list)
            to[i++] = arena_text(&r->memory, e->valuestring);
    cJSON_Delete(list);
    return good && arena_check(&r->memory, "names", err) == 0 ? to : NULL;
}

/* The columns of our components. */
static int label_columns(struct label_rows *r, const struct safetensors *st,
                         struct error *err)
{
    const char **name = label_list(r, st, "blendshape_names", r->columns, err);
    int known = 0;

    for (int k = 0; k < ARKIT_COUNT; k++)
        r->column[k] = -1;
    for (size_t i = 0; name && i < r->columns; i++) {
        int c[2], n = arkit_find(c, name[i]);

        for (int k = 0; k < n; k++)
            r->column[c[k]] = (int)i;
        known += n > 0;
    }
    return !name ? -1 : known ? 0
           : error_set(err, EX_DATAERR, "%s: metadata blendshape_names: none "
                       "of ARKit's is there", st_path(st));
}

/* The arrays, whose lengths must agree. */
static int label_arrays(struct label_rows *r, const struct safetensors *st,
                        struct error *err)
{
    size_t dims[3] = {0, LANDMARK_COUNT, 3}, two[2] = {0}, count;

    r->landmark = arena_keep(&r->memory, st_load_f32(st, "landmarks", 3, dims,
                                                     &count, err), err);
    if (!r->landmark)
        return -1;
    r->n = two[0] = count / (3 * LANDMARK_COUNT);
    r->found = arena_keep(&r->memory, st_load_i32(st, "found", 1, two, NULL,
                                                  err), err);
    if (!r->found)
        return -1;
    r->blend = arena_keep(&r->memory, st_load_f32(st, "blendshapes", 2, two,
                                                  NULL, err), err);
    if (!r->blend)
        return -1;
    r->columns = st_find(st, "blendshapes")->dim[1];
    r->name = label_list(r, st, "names", r->n, err);
    return r->name ? label_columns(r, st, err) : -1;
}

int label_rows_read(struct label_rows *r, const char *path, struct error *err)
{
    struct safetensors *st = st_open(path, err);

    *r = (struct label_rows){0};
    const int rc = st ? label_arrays(r, st, err) : -1;
    st_close(st);
    return rc;
}

void label_rows_release(struct label_rows *r)
{
    arena_release(&r->memory);
}

double label_gain(int k)
{
    if (k == ARKIT_EYE_BLINK_L || k == ARKIT_EYE_BLINK_R)
        return 1.5;
    return k == ARKIT_JAW_OPENED ? 1.25 : 1.1;
}
