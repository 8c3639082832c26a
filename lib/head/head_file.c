/* A head from its file: every array by name, with its shape, converted where
 * the file holds it packed. */
#include "lib/head/head.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/safetensors.h"
#include "lib/base/arena.h"
#include "lib/head/head_fill.h"
#include "lib/head/runs.h"

enum { MAX_DIRECTIONS = 4096 };     /* of a packed file, which could lie */

/* An array of the file; what had to be converted for it is l's. */
static const float *head_take_f32(struct arena *l,
                                  const struct safetensors *st,
                                  const char *name, int ndim, size_t d0,
                                  size_t d1, size_t d2, struct error *err)
{
    size_t dims[3] = {d0, d1, d2};
    float *own = NULL;
    const float *x = st_borrow_f32(st, name, ndim, dims, &own, err);

    return own && !arena_keep(l, own, err) ? NULL : x;
}

static const int32_t *head_take_i32(struct arena *l,
                                    const struct safetensors *st,
                                    const char *name, int ndim, size_t d0,
                                    size_t d1, size_t *count, struct error *err)
{
    size_t dims[2] = {d0, d1};

    return arena_keep(l, st_load_i32(st, name, ndim, dims, count, err), err);
}

/* A number from the metadata, or the default when the key is absent. */
static int head_meta_number(double *out, const struct safetensors *st,
                            const char *key, double fallback, struct error *err)
{
    const char *text = st_meta(st, key);
    char *end;

    *out = fallback;
    if (!text)
        return 0;
    *out = strtod(text, &end);
    if (end == text || *end || !(*out >= 0) || *out > 1e6)
        return error_set(err, EX_DATAERR, "%s: metadata \"%s\" is \"%s\" "
                         "(expected a number)", st_path(st), key, text);
    return 0;
}

/* The runs of directions `name` (V,3,K) that a file may hold in their place:
 * name_runs i32 [n,3] and name_values f16 [rows,3] (lib/head/runs.h), checked
 * but for being finite; the values stay in the file.  1: taken; 0: it has
 * none. */
static int head_take_runs(struct runs_read *r, struct arena *l,
                          const struct safetensors *st, const char *name,
                          size_t V, size_t K, struct error *err)
{
    char runs[64], values[64];
    size_t dims[2] = {0, 3}, n, rows;

    snprintf(runs, sizeof runs, "%s_runs", name);
    if (!st_find(st, runs))
        return 0;
    snprintf(values, sizeof values, "%s_values", name);
    const int32_t *run = head_take_i32(l, st, runs, 2, 0, 3, &n, err);
    const void *value = run ? st_borrow_f16(st, values, 2, dims, &rows, err)
                            : NULL;
    if (!value)
        return -1;
    *r = (struct runs_read){run, n / 3, value, rows / 3, V, K};
    if (runs_check(r, err)) {
        error_prefix(err, "%s: %s", st_path(st), runs);
        return -1;
    }
    return 1;
}

/* The shape directions, dense or packed. */
static int head_take_shapes(struct head_arrays *a, struct runs_read *packed,
                            struct arena *l, const struct safetensors *st,
                            struct error *err)
{
    const size_t K = a->nshape + a->nexp;
    int rc = head_take_runs(packed, l, st, "shapedirs", a->V, K, err);

    if (rc == 0)
        a->shapedirs = head_take_f32(l, st, "shapedirs", 3, a->V, 3, K, err);
    return rc < 0 || (rc == 0 && !a->shapedirs) ? -1 : 0;
}

/* The pose correctives, which are few. */
static const float *head_take_posedirs(struct arena *l,
                                       const struct safetensors *st, size_t V,
                                       struct error *err)
{
    struct runs_read r;
    int rc = head_take_runs(&r, l, st, "posedirs", V, HEAD_POSE_DIRS, err);

    if (rc == 0)
        return head_take_f32(l, st, "posedirs", 3, V, 3, HEAD_POSE_DIRS, err);
    return rc < 0 ? NULL : arena_keep(l, runs_unpack(&r, err), err);
}

/* K, the number of directions: of the tensor or, when it is packed, by the
 * metadata; -1 when neither is sound. */
static int head_read_count(size_t *K, const struct safetensors *st,
                           struct error *err)
{
    const struct st_tensor *t = st_find(st, "shapedirs");
    double nshape, nexp;

    if (st_find(st, "shapedirs_runs")) {
        if (head_meta_number(&nshape, st, "nshape", 300, err) ||
            head_meta_number(&nexp, st, "nexp", 100, err))
            return -1;
        *K = (size_t)(nshape + nexp);
        return *K <= MAX_DIRECTIONS ? 0 : error_set(err, EX_DATAERR,
            "%s: metadata has %zu directions (expected at most %d)",
            st_path(st), *K, MAX_DIRECTIONS);
    }
    if (!t || t->ndim != 3 || t->dim[1] != 3)
        return error_set(err, EX_DATAERR, "%s: shapedirs %s (expected "
                         "[V,3,K])", st_path(st),
                         t ? "has a wrong shape" : "is missing");
    *K = t->dim[2];
    return 0;
}

/* Sizes from the shapes of v_template, f and shapedirs and the metadata. */
static int head_read_sizes(struct head_arrays *a, const struct safetensors *st,
                           struct error *err)
{
    static const char *const names[2] = {"v_template", "f"};
    const struct st_tensor *t[2];
    double scale, nshape;
    size_t K = 0;

    for (int i = 0; i < 2; i++) {
        t[i] = st_find(st, names[i]);
        if (!t[i] || t[i]->ndim != 2 || t[i]->dim[1] != 3)
            return error_set(err, EX_DATAERR, "%s: %s %s (expected [%s,3])",
                             st_path(st), names[i],
                             t[i] ? "has a wrong shape" : "is missing",
                             i ? "F" : "V");
    }
    if (head_read_count(&K, st, err))
        return -1;
    if (head_meta_number(&scale, st, "scale", 5, err) ||
        head_meta_number(&nshape, st, "nshape", K < 300 ? (double)K : 300, err))
        return -1;
    if (nshape > (double)K)
        return error_set(err, EX_DATAERR, "%s: metadata \"nshape\" is %g "
                         "(expected at most %zu, the directions there are)",
                         st_path(st), nshape, K);
    if (!(scale > 0))
        return error_set(err, EX_DATAERR, "%s: metadata \"scale\" is %g "
                         "(expected a positive number)", st_path(st), scale);
    a->V = t[0]->dim[0];
    a->F = t[1]->dim[0];
    a->nshape = (size_t)nshape;
    a->nexp = K - a->nshape;
    a->scale = (float)scale;
    return 0;
}

/* What shapes add to the lids. */
static int head_read_lids(struct head_arrays *a, struct arena *l,
                          const struct safetensors *st, struct error *err)
{
    const struct st_tensor *t = st_find(st, "lid_shapedirs");

    if (t->ndim != 3 || t->dim[1] != 3)
        return error_set(err, EX_DATAERR, "%s: lid_shapedirs has a wrong "
                         "shape (expected [n,3,m])", st_path(st));
    a->nlid = t->dim[0];
    a->nlid_shape = t->dim[2];
    return (a->lid_vertices = head_take_i32(l, st, "lid_vertices", 1, a->nlid,
                                            0, NULL, err)) &&
                   (a->lid_sides = head_take_i32(l, st, "lid_sides", 1, a->nlid,
                                                 0, NULL, err)) &&
                   (a->lid_shapedirs = head_take_f32(l, st, "lid_shapedirs", 3,
                                                     a->nlid, 3, a->nlid_shape,
                                                     err))
               ? 0
               : -1;
}

/* What a head may lack. */
static int head_read_optional(struct head_arrays *a, struct arena *l,
                              const struct safetensors *st, struct error *err)
{
    const size_t V = a->V;

    if (st_find(st, "region") &&
        !(a->region = head_take_i32(l, st, "region", 1, V, 0, NULL, err)))
        return -1;
    if (st_find(st, "hair") &&
        !(a->hair = head_take_f32(l, st, "hair", 1, V, 0, 0, err)))
        return -1;
    if (st_find(st, "uv") &&
        !(a->uv = head_take_f32(l, st, "uv", 2, V, 2, 0, err)))
        return -1;
    return st_find(st, "lid_shapedirs") ? head_read_lids(a, l, st, err) : 0;
}

/* Required arrays first, then those that a head may lack. */
static int head_read_arrays(struct head_arrays *a, struct runs_read *packed,
                            struct arena *l, const struct safetensors *st,
                            struct error *err)
{
    size_t V = a->V;

    if (!(a->v_template = head_take_f32(l, st, "v_template", 2, V, 3, 0,
                                        err)) ||
        !(a->f = head_take_i32(l, st, "f", 2, a->F, 3, NULL, err)) ||
        head_take_shapes(a, packed, l, st, err) ||
        !(a->posedirs = head_take_posedirs(l, st, V, err)) ||
        !(a->J_regressor = head_take_f32(l, st, "J_regressor", 2, HEAD_JOINTS,
                                         V, 0, err)) ||
        !(a->weights = head_take_f32(l, st, "weights", 2, V, HEAD_JOINTS, 0,
                                     err)) ||
        !(a->parents = head_take_i32(l, st, "parents", 1, HEAD_JOINTS, 0, NULL,
                                     err)) ||
        !(a->l_eyelid = head_take_f32(l, st, "l_eyelid", 2, V, 3, 0, err)) ||
        !(a->r_eyelid = head_take_f32(l, st, "r_eyelid", 2, V, 3, 0, err)) ||
        !(a->lip_inner = head_take_i32(l, st, "lip_inner", 1, 0, 0,
                                       &a->nlip_inner, err)) ||
        !(a->lip_upper_outer = head_take_i32(l, st, "lip_upper_outer", 1, 0, 0,
                                             &a->nlip_upper_outer, err)) ||
        !(a->landmark_faces = head_take_i32(l, st, "landmark_faces", 1,
                                            HEAD_LANDMARKS, 0, NULL, err)) ||
        !(a->landmark_bary = head_take_f32(l, st, "landmark_bary", 2,
                                           HEAD_LANDMARKS, 3, 0, err)) ||
        head_read_optional(a, l, st, err))
        return -1;
    if (a->nlip_inner < 3 || a->nlip_upper_outer < 2)
        return error_set(err, EX_DATAERR, "%s: lip_inner has %zu and "
                         "lip_upper_outer %zu vertices (expected at least 3 "
                         "and 2)", st_path(st), a->nlip_inner,
                         a->nlip_upper_outer);
    return 0;
}

int head_load(struct head *h, const char *path, struct error *err)
{
    struct head_arrays a = {0};
    struct runs_read packed = {0};
    struct arena l = {0};
    int rc = -1;

    memset(h, 0, sizeof *h);
    struct safetensors *st = st_open(path, err);
    if (!st)
        return -1;
    if (head_read_sizes(&a, st, err) ||
        head_read_arrays(&a, &packed, &l, st, err))
        goto out;
    rc = head_fill(h, &a, packed.run ? &packed : NULL, st, err);
    if (rc)
        error_prefix(err, "%s", path);
    else if (head_avatar_read(&h->avatar, st, h->V, err)) {
        head_release(h);
        rc = -1;
    }
out:
    arena_release(&l);
    st_close(st);
    return rc;
}
