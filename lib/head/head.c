/* Arrays checked one by one, then laid out in blocks of vertices for the
 * kernels, with a hash of all of them. */
#include "lib/head/head.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <xxhash.h>

#include "formats/safetensors.h"
#include "lib/base/slices.h"
#include "lib/head/head_fill.h"

#define BLOCK HEAD_BLOCK
#define ROW (3 * BLOCK)

/* ---- checking ---------------------------------------------------------- */

/* x (n): numbers first to first + n - 1 of name. */
static int head_check_range(const char *name, const float *x, size_t first,
                            size_t n, struct error *err)
{
    for (size_t i = 0; i < n; i++)
        if (!isfinite(x[i]))
            return error_set(err, EX_DATAERR, "%s[%zu] is %f (expected a "
                             "finite number)", name, first + i, (double)x[i]);
    return 0;
}

static int head_check_finite(const char *name, const float *x, size_t n,
                             struct error *err)
{
    return head_check_range(name, x, 0, n, err);
}

/* Shares from 0 to 1. */
static int head_check_shares(const char *name, const float *x, size_t n,
                             struct error *err)
{
    for (size_t i = 0; i < n; i++)
        if (!(x[i] >= 0 && x[i] <= 1))
            return error_set(err, EX_DATAERR, "%s[%zu] is %f (expected 0 to 1)",
                             name, i, (double)x[i]);
    return 0;
}

/* Indices into an array of `limit`. */
static int head_check_indices(const char *name, const int32_t *x, size_t n,
                              size_t limit, struct error *err)
{
    for (size_t i = 0; i < n; i++)
        if (x[i] < 0 || (size_t)x[i] >= limit)
            return error_set(err, EX_DATAERR, "%s[%zu] is %d (expected 0 to "
                             "%zu)", name, i, x[i], limit - 1);
    return 0;
}

/* Each of n rows of m numbers sums to 1. */
static int head_check_sums(const char *name, const float *x, size_t n, size_t m,
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

/* A joint's parent comes before it; the first is the root. */
static int head_check_parents(const int32_t *parents, struct error *err)
{
    for (int j = 0; j < HEAD_JOINTS; j++)
        if (j == 0 ? parents[0] != -1
                   : parents[j] < 0 || parents[j] >= j)
            return error_set(err, EX_DATAERR, "parents[%d] is %d (expected "
                             "%s)", j, parents[j],
                             j ? "an earlier joint" : "-1");
    return 0;
}

/* The same of the lids that follow the eyes. */
static int head_check_lids(const struct head_arrays *a, struct error *err)
{
    if (a->nlid_shape > a->nshape)
        return error_set(err, EX_DATAERR, "lid_shapedirs has %zu directions "
                         "(expected at most %zu, the head's)", a->nlid_shape,
                         a->nshape);
    return head_check_indices("lid_vertices", a->lid_vertices, a->nlid, a->V,
                              err) ||
           head_check_indices("lid_sides", a->lid_sides, a->nlid, 2, err) ||
           head_check_finite("lid_shapedirs", a->lid_shapedirs,
                             3 * a->nlid * a->nlid_shape, err) ? -1 : 0;
}

/* What later code takes for granted: sizes, and indices that stay inside. */
static int head_check_arrays(const struct head_arrays *a, struct error *err)
{
    size_t V = a->V;

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
    if (head_check_finite("v_template", a->v_template, 3 * V, err) ||
        head_check_finite("posedirs", a->posedirs, 3 * V * HEAD_POSE_DIRS,
                          err) ||
        head_check_finite("J_regressor", a->J_regressor, HEAD_JOINTS * V,
                          err) ||
        head_check_finite("weights", a->weights, HEAD_JOINTS * V, err) ||
        head_check_finite("l_eyelid", a->l_eyelid, 3 * V, err) ||
        head_check_finite("r_eyelid", a->r_eyelid, 3 * V, err) ||
        head_check_indices("f", a->f, 3 * a->F, V, err) ||
        head_check_indices("lip_inner", a->lip_inner, a->nlip_inner, V, err) ||
        head_check_indices("lip_upper_outer", a->lip_upper_outer,
                           a->nlip_upper_outer, V, err) ||
        head_check_sums("weights", a->weights, V, HEAD_JOINTS, 1e-4, err) ||
        head_check_sums("J_regressor", a->J_regressor, HEAD_JOINTS, V, 1e-3,
                        err))
        return -1;
    if (a->landmark_faces &&
        (head_check_indices("landmark_faces", a->landmark_faces, HEAD_LANDMARKS,
                            a->F, err) ||
         head_check_finite("landmark_bary", a->landmark_bary,
                           3 * HEAD_LANDMARKS, err) ||
         head_check_sums("landmark_bary", a->landmark_bary, HEAD_LANDMARKS, 3,
                         1e-3, err)))
        return -1;
    if ((a->hair && head_check_shares("hair", a->hair, V, err)) ||
        (a->uv && head_check_finite("uv", a->uv, 2 * V, err)) ||
        (a->region && head_check_indices("region", a->region, V, 256, err)))
        return -1;
    return head_check_lids(a, err) || head_check_parents(a->parents, err) ? -1
                                                                          : 0;
}

/* ---- the posing layout ------------------------------------------------- */

/* Where component c of vertex v lies in a row of its block. */
static size_t head_block_lane(size_t v, int c)
{
    return (size_t)c * BLOCK + v % BLOCK;
}

/* Where n columns of directions go: out (blocks, n, 96), zeros at first, and
 * in `words` words of a block (0: not asked for) the bits of those that move
 * something in it. */
struct head_layout {
    float *out;
    size_t first, n;            /* columns */
    uint64_t *live;
    size_t words;
};

/* A block's rows k0 .. k0 + few - 1, those that are not zero. */
static void head_block_put(const struct head_layout *l,
                           const float rows[][ROW], size_t b, size_t k0,
                           size_t few)
{
    for (size_t k = 0; k < few; k++) {
        size_t i = 0;

        while (i < ROW && rows[k][i] == 0)
            i++;
        if (i == ROW)
            continue;           /* pages of zeros stay untouched */
        memcpy(l->out + (b * l->n + k0 + k) * ROW, rows[k], sizeof rows[k]);
        if (l->words)
            l->live[b * l->words + (k0 + k) / 64] |=
                (uint64_t)1 << (k0 + k) % 64;
    }
}

/* Of x (to - from, 3, stride) of the vertices from (a block's first) to
 * to - 1. */
static void head_block_rows(const struct head_layout *l, const float *x,
                            size_t from, size_t to, size_t stride, float scale)
{
    enum { FEW = 16 };          /* columns of a line, rows that stay near */
    float rows[FEW][ROW];

    for (size_t b = from / BLOCK; b * BLOCK < to; b++)
        for (size_t k0 = 0; k0 < l->n; k0 += FEW) {
            const size_t few = l->n - k0 < FEW ? l->n - k0 : FEW;

            memset(rows, 0, sizeof rows);
            for (size_t v = b * BLOCK; v < to && v < (b + 1) * BLOCK; v++)
                for (int c = 0; c < 3; c++) {
                    const float *col = x + (3 * (v - from) + (size_t)c)
                                           * stride + l->first + k0;

                    for (size_t k = 0; k < few; k++)
                        rows[k][head_block_lane(v, c)] = scale * col[k];
                }
            head_block_put(l, (const float (*)[ROW])rows, b, k0, few);
        }
}

/* Skinning weights by blocks of vertices, as the posing kernel reads them. */
static void head_block_skin(float *out, const float *weights, size_t V)
{
    for (size_t v = 0; v < V; v++)
        for (int j = 0; j < HEAD_JOINTS; j++)
            out[v / BLOCK * HEAD_JOINTS * BLOCK + (size_t)j * BLOCK +
                v % BLOCK] = weights[HEAD_JOINTS * v + j];
}

/* J of the template.  Regression is linear, so joints of any shape are
 * joint_template + joint_dirs * coefficients. */
static void head_regress_template(struct head *h, const struct head_arrays *a)
{
    for (int j = 0; j < HEAD_JOINTS; j++)
        for (int c = 0; c < 3; c++) {
            const float *w = a->J_regressor + (size_t)j * a->V;
            double sum = 0;

            for (size_t v = 0; v < a->V; v++)
                sum += (double)w[v] * a->v_template[3 * v + c];
            h->joint_template[3 * j + c] = (float)(h->scale * sum);
        }
}

/* J of every direction: what the vertices from .. to - 1, whose directions
 * are rows, add to sum (K,15). */
static void head_regress_rows(double *sum, const struct head_arrays *a,
                              const float *rows, size_t from, size_t to)
{
    size_t K = a->nshape + a->nexp;

    for (size_t v = from; v < to; v++)
        for (size_t j = 0; j < HEAD_JOINTS; j++) {
            double w = a->J_regressor[j * a->V + v];

            if (w == 0)
                continue;
            for (size_t c = 0; c < 3; c++)
                for (size_t k = 0; k < K; k++)
                    sum[15 * k + 3 * j + c] +=
                        w * rows[(3 * (v - from) + c) * K + k];
        }
}

/* Some vertices' directions: checked, hashed, regressed and laid out. */
static int head_take_rows(struct head *h, double *sum, XXH64_state_t *hash,
                          const struct head_arrays *a, const float *rows,
                          size_t from, size_t to, struct error *err)
{
    const size_t K = a->nshape + a->nexp, n = 3 * K * (to - from);
    const struct head_layout layout[2] = {
        {h->shape_dirs, 0, a->nshape, h->shape_live, (a->nshape + 63) / 64},
        {h->exp_dirs, a->nshape, a->nexp, h->exp_live, HEAD_MAX_EXP / 64}
    };

    if (head_check_range("shapedirs", rows, 3 * K * from, n, err))
        return -1;
    XXH64_update(hash, rows, n * sizeof *rows);
    for (int i = 0; i < 2; i++)
        head_block_rows(&layout[i], rows, from, to, K, h->scale);
    head_regress_rows(sum, a, rows, from, to);
    return 0;
}

/* The directions, nine tenths of a model, in one pass of some hundred
 * kilobytes at a time, so that neither a mapped file (st, NULL for arrays in
 * memory) nor what is unpacked need stay beside what is made of it. */
static int head_take_directions(struct head *h, XXH64_state_t *hash,
                                const struct head_arrays *a,
                                const struct runs_read *packed,
                                const struct safetensors *st, struct error *err)
{
    const size_t K = a->nshape + a->nexp, some = 2 * BLOCK;
    double *sum = calloc(15 * K + 1, sizeof *sum);
    float *window = packed ? malloc(3 * K * some * sizeof *window) : NULL;
    int rc = sum && (window || !packed)
                 ? 0 : error_set(err, EX_OSERR, "no memory for %zu directions",
                                 K);

    for (size_t v = 0; !rc && v < a->V; v += some) {
        const size_t to = a->V - v < some ? a->V : v + some;
        const size_t n = 3 * K * (to - v);
        const float *rows = packed ? window : a->shapedirs + 3 * K * v;

        if (packed) {
            memset(window, 0, n * sizeof *window);
            runs_unpack_some(window, packed, v, to);
        }
        rc = head_take_rows(h, sum, hash, a, rows, v, to, err);
        if (st && !packed)
            st_forget(st, rows, n * sizeof *rows);
    }
    for (size_t k = 0; !rc && k < 15 * K; k++)
        *(k < 15 * a->nshape ? h->joint_shape + k
                             : h->joint_exp + k - 15 * a->nshape) =
            (float)(h->scale * sum[k]);
    free(window);
    free(sum);
    return rc;
}

/* The hash covers what decides where vertices go, in this order. */
static void head_hash_begin(XXH64_state_t *s, const struct head *h,
                            const struct head_arrays *a)
{
    uint64_t sizes[4] = {a->V, a->F, a->nshape, a->nexp};

    XXH64_reset(s, 0);
    XXH64_update(s, sizes, sizeof sizes);
    XXH64_update(s, &h->scale, sizeof h->scale);
    XXH64_update(s, a->v_template, 3 * a->V * sizeof(float));
    XXH64_update(s, a->f, 3 * a->F * sizeof(int32_t));
}

/* What follows the directions, and the digest as 16 hexadecimal digits. */
static void head_hash_end(struct head *h, XXH64_state_t *s,
                          const struct head_arrays *a)
{
    XXH64_update(s, a->posedirs,
                 3 * a->V * HEAD_POSE_DIRS * sizeof(float));
    XXH64_update(s, a->weights, HEAD_JOINTS * a->V * sizeof(float));
    XXH64_update(s, a->lip_inner, a->nlip_inner * sizeof(int32_t));
    if (a->nlid)
        XXH64_update(s, a->lid_shapedirs,
                     3 * a->nlid * a->nlid_shape * sizeof(float));
    snprintf(h->hash, sizeof h->hash, "%016" PRIx64, XXH64_digest(s));
}

/* ---- making and freeing ------------------------------------------------ */

/* A copy to own; NULL stays NULL. */
static void *head_copy(struct head *h, const void *from, size_t bytes)
{
    void *p = from ? arena_take(&h->memory, bytes, 1) : NULL;

    return p ? memcpy(p, from, bytes) : NULL;
}

/* Copies of the arrays, and zeros up to whole blocks of the kernels. */
static int head_allocate(struct head *h, const struct head_arrays *a,
                         struct error *err)
{
    const size_t V = a->V, B = h->blocks, lids = a->nlid * sizeof(int32_t);
    struct arena *m = &h->memory;
    const struct slice floats[] = {
        {&h->shape_dirs, B * a->nshape * ROW, false},
        {&h->exp_dirs, B * a->nexp * ROW, false},
        {&h->pose_dirs, B * HEAD_POSE_DIRS * ROW, false},
        {&h->v_template, 3 * V, false}, {&h->l_eyelid, 3 * V, false},
        {&h->r_eyelid, 3 * V, false},
        {&h->skin, B * HEAD_JOINTS * BLOCK, false},
        {&h->lids, B * 2 * ROW, false}, {&h->template_blocks, B * ROW, false},
        {&h->joint_shape, 15 * a->nshape, false},
        {&h->joint_exp, 15 * a->nexp, false}
    };

    h->f = head_copy(h, a->f, 3 * a->F * sizeof *h->f);
    h->weights = head_copy(h, a->weights, HEAD_JOINTS * V * sizeof(float));
    h->lip_inner = head_copy(h, a->lip_inner, a->nlip_inner * sizeof(int32_t));
    h->lip_upper_outer = head_copy(h, a->lip_upper_outer,
                                   a->nlip_upper_outer * sizeof(int32_t));
    h->region = head_copy(h, a->region, V * sizeof(int32_t));
    h->hair = head_copy(h, a->hair, V * sizeof(float));
    h->uv = head_copy(h, a->uv, 2 * V * sizeof(float));
    h->lid_vertices = head_copy(h, a->lid_vertices, lids);
    h->lid_sides = head_copy(h, a->lid_sides, lids);
    h->lid_shapedirs = head_copy(h, a->lid_shapedirs, 3 * a->nlid *
                                 a->nlid_shape * sizeof(float));
    h->shape_live = arena_take(m, B * ((a->nshape + 63) / 64),
                               sizeof *h->shape_live);
    h->exp_live = arena_take(m, B * HEAD_MAX_EXP / 64, sizeof *h->exp_live);
    h->pose_live = arena_take(m, B, sizeof *h->pose_live);
    if (!arena_check(m, "a head", err) &&
        !slices_allocate(&h->floats, floats, sizeof floats / sizeof *floats,
                         false, err))
        return 0;
    head_release(h);
    return -1;
}

/* What has a fixed size, or is optional. */
static void head_copy_small(struct head *h, const struct head_arrays *a)
{
    const struct head_layout pose = {h->pose_dirs, 0, HEAD_POSE_DIRS,
                                     h->pose_live, 1};

    memcpy(h->parents, a->parents, sizeof h->parents);
    if (a->landmark_faces) {
        memcpy(h->landmark_faces, a->landmark_faces,
               sizeof h->landmark_faces);
        memcpy(h->landmark_bary, a->landmark_bary, sizeof h->landmark_bary);
        h->has_landmarks = 1;
    }
    for (size_t i = 0; i < 3 * a->V; i++) {
        h->v_template[i] = h->scale * a->v_template[i];
        h->l_eyelid[i] = h->scale * a->l_eyelid[i];
        h->r_eyelid[i] = h->scale * a->r_eyelid[i];
    }
    head_block_rows(&(struct head_layout){.out = h->template_blocks, .n = 1},
                    a->v_template, 0, a->V, 1, h->scale);
    head_block_rows(&pose, a->posedirs, 0, a->V, HEAD_POSE_DIRS, h->scale);
    for (size_t v = 0; v < a->V; v++)
        for (int c = 0; c < 3; c++) {
            float *row = h->lids + v / BLOCK * 2 * ROW + head_block_lane(v, c);
            row[0] = h->l_eyelid[3 * v + c];
            row[ROW] = h->r_eyelid[3 * v + c];
        }
    for (size_t i = 0; i < 3 * a->nlid * a->nlid_shape; i++)
        h->lid_shapedirs[i] *= h->scale;
    h->jaw_shape = 1;
    for (size_t v = 0; v < a->V; v++)
        h->jaw_shape &= a->weights[HEAD_JOINTS * v + JOINT_JAW] == 0;
    head_block_skin(h->skin, a->weights, a->V);
    head_regress_template(h, a);
}

int head_fill(struct head *h, const struct head_arrays *a,
              const struct runs_read *packed, const struct safetensors *st,
              struct error *err)
{
    memset(h, 0, sizeof *h);
    if (head_check_arrays(a, err))
        return -1;
    h->V = a->V;
    h->F = a->F;
    h->nshape = a->nshape;
    h->nexp = a->nexp;
    h->blocks = (a->V + BLOCK - 1) / BLOCK;
    h->scale = a->scale > 0 ? a->scale : 5;
    h->nlip_inner = a->nlip_inner;
    h->nlip_upper_outer = a->nlip_upper_outer;
    h->nlid = a->nlid;
    h->nlid_shape = a->nlid_shape;
    if (head_allocate(h, a, err))
        return -1;
    XXH64_state_t *hash = XXH64_createState();
    head_hash_begin(hash, h, a);
    head_copy_small(h, a);
    int rc = head_take_directions(h, hash, a, packed, st, err);
    head_hash_end(h, hash, a);
    XXH64_freeState(hash);
    if (rc)
        head_release(h);
    else
        head_find_chin(h);
    return rc;
}

int head_init(struct head *h, const struct head_arrays *a, struct error *err)
{
    return head_fill(h, a, NULL, NULL, err);
}

void head_release(struct head *h)
{
    head_avatar_release(&h->avatar);
    arena_release(&h->memory);
    free(h->floats);
    memset(h, 0, sizeof *h);
}
