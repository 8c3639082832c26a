#include "lib/head/head.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <xxhash.h>

#include "formats/safetensors.h"

#define BLOCK HEAD_BLOCK
#define ROW (3 * BLOCK)

/* ---- checking ---------------------------------------------------------- */

static int check_finite(const char *name, const float *x, size_t n,
                        struct error *err)
{
    for (size_t i = 0; i < n; i++)
        if (!isfinite(x[i]))
            return error_set(err, EX_DATAERR, "%s[%zu] is %f (expected a "
                             "finite number)", name, i, (double)x[i]);
    return 0;
}

static int check_indices(const char *name, const int32_t *x, size_t n,
                         size_t limit, struct error *err)
{
    for (size_t i = 0; i < n; i++)
        if (x[i] < 0 || (size_t)x[i] >= limit)
            return error_set(err, EX_DATAERR, "%s[%zu] is %d (expected 0 to "
                             "%zu)", name, i, x[i], limit - 1);
    return 0;
}

/* Each of n rows of m numbers sums to 1. */
static int check_sums(const char *name, const float *x, size_t n, size_t m,
                      double tolerance, struct error *err)
{
    for (size_t i = 0; i < n; i++) {
        double sum = 0;

        for (size_t j = 0; j < m; j++)
            sum += x[i * m + j];
        if (fabs(sum - 1) > tolerance)
            return error_set(err, EX_DATAERR, "%s[%zu] sums to %.6g "
                             "(expected 1 within %g)", name, i, sum,
                             tolerance);
    }
    return 0;
}

static int check_parents(const int32_t *parents, struct error *err)
{
    for (int j = 0; j < HEAD_JOINTS; j++)
        if (j == 0 ? parents[0] != -1
                   : parents[j] < 0 || parents[j] >= j)
            return error_set(err, EX_DATAERR, "parents[%d] is %d (expected "
                             "%s)", j, parents[j],
                             j ? "an earlier joint" : "-1");
    return 0;
}

static int check_arrays(const struct head_arrays *a, struct error *err)
{
    size_t V = a->V, K = a->nshape + a->nexp;

    if (V == 0 || a->F == 0 || V > 10000000 || a->F > 40000000)
        return error_set(err, EX_DATAERR, "head has %zu vertices and %zu "
                         "faces (expected at least one of each)", V, a->F);
    if (a->nexp > HEAD_MAX_EXP)
        return error_set(err, EX_DATAERR, "head has %zu expression "
                         "directions (expected at most %d)", a->nexp,
                         HEAD_MAX_EXP);
    if (a->scale < 0 || !isfinite(a->scale))
        return error_set(err, EX_DATAERR, "head scale is %f (expected a "
                         "positive number)", (double)a->scale);
    if (check_finite("v_template", a->v_template, 3 * V, err) ||
        check_finite("shapedirs", a->shapedirs, 3 * V * K, err) ||
        check_finite("posedirs", a->posedirs, 3 * V * HEAD_POSE_DIRS, err) ||
        check_finite("J_regressor", a->J_regressor, HEAD_JOINTS * V, err) ||
        check_finite("weights", a->weights, HEAD_JOINTS * V, err) ||
        check_finite("l_eyelid", a->l_eyelid, 3 * V, err) ||
        check_finite("r_eyelid", a->r_eyelid, 3 * V, err) ||
        check_indices("f", a->f, 3 * a->F, V, err) ||
        check_indices("lip_inner", a->lip_inner, a->nlip_inner, V, err) ||
        check_indices("lip_upper_outer", a->lip_upper_outer,
                      a->nlip_upper_outer, V, err) ||
        check_sums("weights", a->weights, V, HEAD_JOINTS, 1e-4, err) ||
        check_sums("J_regressor", a->J_regressor, HEAD_JOINTS, V, 1e-3, err))
        return -1;
    if (a->landmark_faces &&
        (check_indices("landmark_faces", a->landmark_faces, HEAD_LANDMARKS,
                       a->F, err) ||
         check_finite("landmark_bary", a->landmark_bary, 3 * HEAD_LANDMARKS,
                      err) ||
         check_sums("landmark_bary", a->landmark_bary, HEAD_LANDMARKS, 3,
                    1e-3, err)))
        return -1;
    if ((a->hair && check_finite("hair", a->hair, V, err)) ||
        (a->uv && check_finite("uv", a->uv, 2 * V, err)) ||
        (a->region && check_indices("region", a->region, V, 256, err)))
        return -1;
    return check_parents(a->parents, err);
}

/* ---- the posing layout ------------------------------------------------- */

/* Where component c of vertex v lies in a row of its block. */
static size_t lane(size_t v, int c)
{
    return (size_t)c * BLOCK + v % BLOCK;
}

/* out (blocks, n, 96) from x (V, 3, stride): columns first..first+n. */
static void block_dirs(float *out, const float *x, size_t V, size_t stride,
                       size_t first, size_t n, float scale)
{
    for (size_t v = 0; v < V; v++)
        for (int c = 0; c < 3; c++) {
            const float *col = x + (3 * v + c) * stride + first;
            float *row = out + v / BLOCK * n * ROW + lane(v, c);

            for (size_t k = 0; k < n; k++)
                row[k * ROW] = scale * col[k];
        }
}

static void block_skin(float *out, const float *weights, size_t V)
{
    for (size_t v = 0; v < V; v++)
        for (int j = 0; j < HEAD_JOINTS; j++)
            out[v / BLOCK * HEAD_JOINTS * BLOCK + (size_t)j * BLOCK +
                v % BLOCK] = weights[HEAD_JOINTS * v + j];
}

/* J of the template and of every direction: regression is linear, so joints
 * of any shape are joint_template + joint_dirs * coefficients. */
static void regress_joints(struct head *h, const struct head_arrays *a)
{
    size_t K = a->nshape + a->nexp;

    for (int j = 0; j < HEAD_JOINTS; j++)
        for (int c = 0; c < 3; c++) {
            const float *w = a->J_regressor + (size_t)j * a->V;
            double sum = 0;

            for (size_t v = 0; v < a->V; v++)
                sum += (double)w[v] * a->v_template[3 * v + c];
            h->joint_template[3 * j + c] = (float)(h->scale * sum);
        }
    for (size_t k = 0; k < K; k++) {
        float *out = k < a->nshape ? h->joint_shape + 15 * k
                                   : h->joint_exp + 15 * (k - a->nshape);
        double sum[15] = {0};

        for (int j = 0; j < HEAD_JOINTS; j++)
            for (size_t v = 0; v < a->V; v++) {
                double w = a->J_regressor[(size_t)j * a->V + v];
                if (w == 0)
                    continue;
                for (int c = 0; c < 3; c++)
                    sum[3 * j + c] += w * a->shapedirs[(3 * v + c) * K + k];
            }
        for (int i = 0; i < 15; i++)
            out[i] = (float)(h->scale * sum[i]);
    }
}

static void hash_head(struct head *h, const struct head_arrays *a)
{
    XXH64_state_t *s = XXH64_createState();
    size_t V = a->V, K = a->nshape + a->nexp;
    uint64_t sizes[4] = {V, a->F, a->nshape, a->nexp};
    static const char hex[] = "0123456789abcdef";

    XXH64_reset(s, 0);
    XXH64_update(s, sizes, sizeof sizes);
    XXH64_update(s, &h->scale, sizeof h->scale);
    XXH64_update(s, a->v_template, 3 * V * sizeof(float));
    XXH64_update(s, a->f, 3 * a->F * sizeof(int32_t));
    XXH64_update(s, a->shapedirs, 3 * V * K * sizeof(float));
    XXH64_update(s, a->posedirs, 3 * V * HEAD_POSE_DIRS * sizeof(float));
    XXH64_update(s, a->weights, HEAD_JOINTS * V * sizeof(float));
    XXH64_update(s, a->lip_inner, a->nlip_inner * sizeof(int32_t));
    uint64_t d = XXH64_digest(s);
    XXH64_freeState(s);
    for (int i = 0; i < 16; i++)
        h->hash[i] = hex[d >> (60 - 4 * i) & 15];
    h->hash[16] = 0;
}

/* ---- making and freeing ------------------------------------------------ */

/* n floats, zeroed, 64-byte aligned; NULL sets *failed. */
static float *zeroed(size_t n, int *failed)
{
    size_t bytes = ((n ? n : 1) * sizeof(float) + 63) / 64 * 64;
    float *p = aligned_alloc(64, bytes);

    if (p)
        memset(p, 0, bytes);
    else
        *failed = 1;
    return p;
}

static void *copy(const void *from, size_t bytes, int *failed)
{
    void *p = from ? malloc(bytes ? bytes : 1) : NULL;

    if (p)
        memcpy(p, from, bytes);
    else if (from)
        *failed = 1;
    return p;
}

static int allocate(struct head *h, const struct head_arrays *a,
                    struct error *err)
{
    size_t V = a->V, B = h->blocks;
    int failed = 0;

    h->v_template = zeroed(3 * V, &failed);
    h->f = copy(a->f, 3 * a->F * sizeof *h->f, &failed);
    h->weights = copy(a->weights, HEAD_JOINTS * V * sizeof(float), &failed);
    h->l_eyelid = zeroed(3 * V, &failed);
    h->r_eyelid = zeroed(3 * V, &failed);
    h->lip_inner = copy(a->lip_inner, a->nlip_inner * sizeof(int32_t),
                        &failed);
    h->lip_upper_outer = copy(a->lip_upper_outer, a->nlip_upper_outer *
                              sizeof(int32_t), &failed);
    h->region = copy(a->region, V * sizeof(int32_t), &failed);
    h->hair = copy(a->hair, V * sizeof(float), &failed);
    h->uv = copy(a->uv, 2 * V * sizeof(float), &failed);
    h->shape_dirs = zeroed(B * a->nshape * ROW, &failed);
    h->exp_dirs = zeroed(B * a->nexp * ROW, &failed);
    h->pose_dirs = zeroed(B * HEAD_POSE_DIRS * ROW, &failed);
    h->skin = zeroed(B * HEAD_JOINTS * BLOCK, &failed);
    h->lids = zeroed(B * 2 * ROW, &failed);
    h->template_blocks = zeroed(B * ROW, &failed);
    h->joint_shape = zeroed(15 * a->nshape, &failed);
    h->joint_exp = zeroed(15 * a->nexp, &failed);
    if (failed) {
        head_release(h);
        return error_set(err, EX_OSERR, "no memory for a head of %zu "
                         "vertices", V);
    }
    return 0;
}

int head_init(struct head *h, const struct head_arrays *a, struct error *err)
{
    size_t V = a->V, K = a->nshape + a->nexp;

    memset(h, 0, sizeof *h);
    if (check_arrays(a, err))
        return -1;
    h->V = V;
    h->F = a->F;
    h->nshape = a->nshape;
    h->nexp = a->nexp;
    h->blocks = (V + BLOCK - 1) / BLOCK;
    h->scale = a->scale > 0 ? a->scale : 5;
    h->nlip_inner = a->nlip_inner;
    h->nlip_upper_outer = a->nlip_upper_outer;
    if (allocate(h, a, err))
        return -1;
    memcpy(h->parents, a->parents, sizeof h->parents);
    if (a->landmark_faces) {
        memcpy(h->landmark_faces, a->landmark_faces,
               sizeof h->landmark_faces);
        memcpy(h->landmark_bary, a->landmark_bary, sizeof h->landmark_bary);
        h->has_landmarks = 1;
    }
    for (size_t i = 0; i < 3 * V; i++) {
        h->v_template[i] = h->scale * a->v_template[i];
        h->l_eyelid[i] = h->scale * a->l_eyelid[i];
        h->r_eyelid[i] = h->scale * a->r_eyelid[i];
    }
    block_dirs(h->template_blocks, a->v_template, V, 1, 0, 1, h->scale);
    block_dirs(h->shape_dirs, a->shapedirs, V, K, 0, a->nshape, h->scale);
    block_dirs(h->exp_dirs, a->shapedirs, V, K, a->nshape, a->nexp,
               h->scale);
    block_dirs(h->pose_dirs, a->posedirs, V, HEAD_POSE_DIRS, 0,
               HEAD_POSE_DIRS, h->scale);
    for (size_t v = 0; v < V; v++)
        for (int c = 0; c < 3; c++) {
            float *row = h->lids + v / BLOCK * 2 * ROW + lane(v, c);
            row[0] = h->l_eyelid[3 * v + c];
            row[ROW] = h->r_eyelid[3 * v + c];
        }
    block_skin(h->skin, a->weights, V);
    regress_joints(h, a);
    hash_head(h, a);
    return 0;
}

void head_release(struct head *h)
{
    float *blocks[] = {h->v_template, h->weights, h->l_eyelid, h->r_eyelid,
                       h->hair, h->uv, h->shape_dirs, h->exp_dirs,
                       h->pose_dirs, h->skin, h->lids, h->template_blocks,
                       h->joint_shape, h->joint_exp};

    for (size_t i = 0; i < sizeof blocks / sizeof *blocks; i++)
        free(blocks[i]);
    free(h->f);
    free(h->lip_inner);
    free(h->lip_upper_outer);
    free(h->region);
    memset(h, 0, sizeof *h);
}

/* ---- from a file ------------------------------------------------------- */

/* The arrays of a file, owned until loaded_release. */
struct loaded {
    float *f32[12];
    int32_t *i32[7];
    int nf, ni;
};

static const float *take_f32(struct loaded *l, const struct safetensors *st,
                             const char *name, int ndim, size_t d0, size_t d1,
                             size_t d2, struct error *err)
{
    size_t dims[3] = {d0, d1, d2};

    return l->f32[l->nf++] = st_load_f32(st, name, ndim, dims, NULL, err);
}

static const int32_t *take_i32(struct loaded *l, const struct safetensors *st,
                               const char *name, int ndim, size_t d0,
                               size_t d1, size_t *count, struct error *err)
{
    size_t dims[2] = {d0, d1};

    return l->i32[l->ni++] = st_load_i32(st, name, ndim, dims, count, err);
}

static void loaded_release(struct loaded *l)
{
    for (int i = 0; i < l->nf; i++)
        free(l->f32[i]);
    for (int i = 0; i < l->ni; i++)
        free(l->i32[i]);
}

/* A number from the metadata, or the default when the key is absent. */
static int meta_number(double *out, const struct safetensors *st,
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

/* Sizes from the shapes of v_template, f and shapedirs and the metadata. */
static int read_sizes(struct head_arrays *a, const struct safetensors *st,
                      struct error *err)
{
    static const char *const names[3] = {"v_template", "f", "shapedirs"};
    const struct st_tensor *t[3];
    double scale, nshape;

    for (int i = 0; i < 3; i++) {
        t[i] = st_find(st, names[i]);
        if (!t[i] || t[i]->ndim != (i == 2 ? 3 : 2) || t[i]->dim[1] != 3)
            return error_set(err, EX_DATAERR, "%s: %s %s (expected [%s,3%s])",
                             st_path(st), names[i],
                             t[i] ? "has a wrong shape" : "is missing",
                             i == 1 ? "F" : "V", i == 2 ? ",K" : "");
    }
    size_t K = t[2]->dim[2];
    if (meta_number(&scale, st, "scale", 5, err) ||
        meta_number(&nshape, st, "nshape", K < 300 ? (double)K : 300, err))
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

static int read_arrays(struct head_arrays *a, struct loaded *l,
                       const struct safetensors *st, struct error *err)
{
    size_t V = a->V;

    if (!(a->v_template = take_f32(l, st, "v_template", 2, V, 3, 0, err)) ||
        !(a->f = take_i32(l, st, "f", 2, a->F, 3, NULL, err)) ||
        !(a->shapedirs = take_f32(l, st, "shapedirs", 3, V, 3,
                                  a->nshape + a->nexp, err)) ||
        !(a->posedirs = take_f32(l, st, "posedirs", 3, V, 3, HEAD_POSE_DIRS,
                                 err)) ||
        !(a->J_regressor = take_f32(l, st, "J_regressor", 2, HEAD_JOINTS, V,
                                    0, err)) ||
        !(a->weights = take_f32(l, st, "weights", 2, V, HEAD_JOINTS, 0,
                                err)) ||
        !(a->parents = take_i32(l, st, "parents", 1, HEAD_JOINTS, 0, NULL,
                                err)) ||
        !(a->l_eyelid = take_f32(l, st, "l_eyelid", 2, V, 3, 0, err)) ||
        !(a->r_eyelid = take_f32(l, st, "r_eyelid", 2, V, 3, 0, err)) ||
        !(a->lip_inner = take_i32(l, st, "lip_inner", 1, 0, 0,
                                  &a->nlip_inner, err)) ||
        !(a->lip_upper_outer = take_i32(l, st, "lip_upper_outer", 1, 0, 0,
                                        &a->nlip_upper_outer, err)) ||
        !(a->landmark_faces = take_i32(l, st, "landmark_faces", 1,
                                       HEAD_LANDMARKS, 0, NULL, err)) ||
        !(a->landmark_bary = take_f32(l, st, "landmark_bary", 2,
                                      HEAD_LANDMARKS, 3, 0, err)))
        return -1;
    if (st_find(st, "region") &&
        !(a->region = take_i32(l, st, "region", 1, V, 0, NULL, err)))
        return -1;
    if (st_find(st, "hair") &&
        !(a->hair = take_f32(l, st, "hair", 1, V, 0, 0, err)))
        return -1;
    if (st_find(st, "uv") &&
        !(a->uv = take_f32(l, st, "uv", 2, V, 2, 0, err)))
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
    struct loaded l = {0};
    int rc = -1;

    memset(h, 0, sizeof *h);
    struct safetensors *st = st_open(path, err);
    if (!st)
        return -1;
    if (read_sizes(&a, st, err) || read_arrays(&a, &l, st, err))
        goto out;
    rc = head_init(h, &a, err);
    if (rc)
        error_prefix(err, "%s", path);
out:
    loaded_release(&l);
    st_close(st);
    return rc;
}
