/* The template avatar's arrays: one table of their names and shapes serves
 * memory, reading and writing. */
#include "lib/head/head_avatar.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

/* What an array has a row for. */
enum rows { ROWS_POINTS, ROWS_VERTICES, ROWS_MOUTH, ROWS_ONE };

static const struct avatar_array {
    const char *name;           /* in the file */
    size_t offset;              /* in the struct */
    enum rows rows;
    size_t width;
} avatar_arrays[] = {
#define ARRAY(name, rows, width)                                              \
    {"avatar." #name, offsetof(struct head_avatar, name), rows, width}
    ARRAY(neck, ROWS_POINTS, 1), ARRAY(lining, ROWS_POINTS, 1),
    ARRAY(lid, ROWS_POINTS, 1), ARRAY(fold, ROWS_POINTS, 1),
    ARRAY(reach, ROWS_POINTS, 1), ARRAY(seam, ROWS_POINTS, 1),
    ARRAY(crease, ROWS_POINTS, 1), ARRAY(lips, ROWS_POINTS, 1),
    ARRAY(hair, ROWS_VERTICES, HEAD_STYLES),
    ARRAY(hair_share, ROWS_ONE, HEAD_STYLES),
    ARRAY(relief, ROWS_VERTICES, HEAD_STYLES),
    ARRAY(cloth, ROWS_VERTICES, HEAD_STYLES),
    ARRAY(cloth_share, ROWS_ONE, HEAD_STYLES),
    ARRAY(stretch, ROWS_POINTS, 1), ARRAY(side, ROWS_POINTS, 1),
    ARRAY(lid_skin, ROWS_POINTS, 1),
    ARRAY(eyeball, ROWS_POINTS, 3), ARRAY(about_eye, ROWS_VERTICES, 2),
    ARRAY(eye_color, ROWS_ONE, 9), ARRAY(moving, ROWS_VERTICES, 1),
    ARRAY(neck_blend, ROWS_ONE, 5), ARRAY(mouth_place, ROWS_MOUTH, 3),
    ARRAY(mouth_size, ROWS_MOUTH, 3), ARRAY(mouth_turn, ROWS_MOUTH, 4),
    ARRAY(mouth_color, ROWS_MOUTH, 3), ARRAY(mouth_jaw, ROWS_MOUTH, 1),
    ARRAY(mouth_layer, ROWS_MOUTH, 1)
#undef ARRAY
};
#define ARRAYS (sizeof avatar_arrays / sizeof *avatar_arrays)

/* Its pointer in a. */
static float **avatar_at(struct head_avatar *a, size_t i)
{
    return (float **)(void *)((char *)a + avatar_arrays[i].offset);
}

static size_t avatar_rows(const struct head_avatar *a, size_t i)
{
    switch (avatar_arrays[i].rows) {
    case ROWS_POINTS: return a->points;
    case ROWS_VERTICES: return a->V;
    case ROWS_MOUTH: return a->mouth * a->mouth;
    default: return 1;
    }
}

int head_avatar_init(struct head_avatar *a, size_t V, size_t D, size_t T,
                     struct error *err)
{
    size_t n = 0;

    *a = (struct head_avatar){.V = V, .points = D, .mouth = T};
    for (size_t i = 0; i < ARRAYS; i++)
        n += avatar_rows(a, i) * avatar_arrays[i].width;
    float *at = a->block = calloc(n, sizeof *at);
    a->mirror = calloc(D, sizeof *a->mirror);
    if (!at || !a->mirror) {
        head_avatar_release(a);
        return error_set(err, EX_OSERR, "no memory for %zu points", D);
    }
    for (size_t i = 0; i < ARRAYS; i++) {
        *avatar_at(a, i) = at;
        at += avatar_rows(a, i) * avatar_arrays[i].width;
    }
    return 0;
}

void head_avatar_release(struct head_avatar *a)
{
    free(a->block);
    free(a->mirror);
    memset(a, 0, sizeof *a);
}

const float *head_avatar_array(const struct head_avatar *a, size_t i,
                               const char **name, size_t *count, size_t *width)
{
    if (i >= ARRAYS)
        return NULL;
    *name = avatar_arrays[i].name;
    *width = avatar_arrays[i].width;
    *count = *width * avatar_rows(a, i);
    return *(float *const *)(const void *)((const char *)a +
                                           avatar_arrays[i].offset);
}

/* The points across the face. */
static int avatar_read_mirror(struct head_avatar *a,
                              const struct safetensors *st, struct error *err)
{
    int32_t *to = st_load_i32(st, "avatar.mirror", 1, &a->points, NULL, err);
    int rc = to ? 0 : -1;

    for (size_t k = 0; rc == 0 && k < a->points; k++) {
        if (to[k] < 0 || (size_t)to[k] >= a->points)
            rc = error_set(err, EX_DATAERR, "%s: avatar.mirror[%zu] is %d "
                           "(expected 0 to %zu)", st_path(st), k, to[k],
                           a->points - 1);
        a->mirror[k] = (size_t)to[k];
    }
    free(to);
    return rc;
}

/* Layers that there are. */
static int avatar_check_layers(const struct head_avatar *a,
                               const struct safetensors *st, struct error *err)
{
    for (size_t k = 0; k < a->mouth * a->mouth; k++)
        if (!(a->mouth_layer[k] >= 0 && a->mouth_layer[k] <= MOUTH_BACK))
            return error_set(err, EX_DATAERR, "%s: avatar.mouth_layer[%zu] is "
                             "%g (expected 0, 1 or 2)", st_path(st), k,
                             (double)a->mouth_layer[k]);
    return 0;
}

int head_avatar_read(struct head_avatar *a, const struct safetensors *st,
                     size_t V, struct error *err)
{
    const struct st_tensor *points = st_find(st, "avatar.neck");
    const struct st_tensor *mouth = st_find(st, "avatar.mouth_jaw");

    *a = (struct head_avatar){0};
    if (!points)
        return 0;
    const size_t T = mouth ? (size_t)sqrt((double)mouth->count) : 0;
    if (points->count < V || T < 2 || T * T != mouth->count)
        return error_set(err, EX_DATAERR, "%s: avatar.neck has %zu and "
                         "avatar.mouth_jaw %zu numbers (expected %zu or more, "
                         "and a square)", st_path(st), points->count,
                         mouth ? mouth->count : 0, V);
    if (head_avatar_init(a, V, points->count, T, err))
        return -1;
    for (size_t i = 0; i < ARRAYS; i++) {
        const struct avatar_array *t = &avatar_arrays[i];
        const size_t dims[2] = {avatar_rows(a, i), t->width};
        float *x = st_load_f32(st, t->name, t->width > 1 ? 2 : 1, dims, NULL,
                               err);

        if (!x) {
            head_avatar_release(a);
            return -1;
        }
        memcpy(*avatar_at(a, i), x, dims[0] * t->width * sizeof *x);
        free(x);
    }
    if (avatar_read_mirror(a, st, err) == 0 &&
        avatar_check_layers(a, st, err) == 0)
        return 0;
    head_avatar_release(a);
    return -1;
}

struct neck_blend head_avatar_neck(const struct head_avatar *a)
{
    const float *n = a->neck_blend;

    return (struct neck_blend){{n[0], n[1], n[2]}, n[3], n[4]};
}
