/* Posing in one pass over memory, compiled per instruction set.  A block is
 * 32 vertices as x[32] y[32] z[32]; its directions lie one after the other,
 * so the sums stay in registers while memory is read front to back. */
#include "lib/head/lbs_kernel.h"

#include <string.h>

#include "lib/base/simd.h"

#define B HEAD_BLOCK
#define ROW (3 * B)
#define HV (B / VEC)      /* vectors of one coordinate */
#define NV (3 * HV)     /* vectors of a row: all x, all y, all z */
#define CHUNK (NV < 12 ? NV : 12)   /* sums held in registers at once */

/* a += value[i] * rows[index[i]] */
static inline void lbs_add_rows(vf a[NV], const float *rows, const int *index,
                                const float *value, size_t n)
{
    for (int c = 0; c < NV; c += CHUNK) {
        vf s[CHUNK];

#pragma GCC unroll 12
        for (int k = 0; k < CHUNK; k++)
            s[k] = a[c + k];
        for (size_t i = 0; i < n; i++) {
            const vf *d = (const vf *)(rows + (size_t)index[i] * ROW) + c;
            float v = value[i];

#pragma GCC unroll 12
            for (int k = 0; k < CHUNK; k++)
                s[k] += v * d[k];
        }
#pragma GCC unroll 12
        for (int k = 0; k < CHUNK; k++)
            a[c + k] = s[k];
    }
}

/* Words of a block's bits in head->exp_live. */
#define WORDS (HEAD_MAX_EXP / 64)

/* Of n directions and their values those that move the block; live NULL: all.
 * Returns how many are in at and with. */
static inline size_t lbs_live_rows(int *at, float *with, const int *index,
                                   const float *value, size_t n,
                                   const uint64_t *live)
{
    size_t m = 0;

    for (size_t i = 0; i < n; i++) {
        size_t k = (size_t)index[i];

        at[m] = index[i];
        with[m] = value[i];
        m += !live || (live[k / 64] >> k % 64 & 1);
    }
    return m;
}

/* p = T + B_S + B_E + B_P of block b. */
static inline void lbs_rest_block(vf p[NV], const struct lbs_frame *fr,
                                  size_t b)
{
    const struct head *h = fr->id->head;
    const vf *shaped = (const vf *)(fr->id->shaped + b * ROW);
    int at[HEAD_MAX_EXP];
    float with[HEAD_MAX_EXP];
    size_t n;

    for (int i = 0; i < NV; i++)
        p[i] = shaped[i];
    n = lbs_live_rows(at, with, fr->exp_index, fr->exp_value, fr->nexp,
                      h->exp_live ? h->exp_live + b * WORDS : NULL);
    lbs_add_rows(p, h->exp_dirs + b * h->nexp * ROW, at, with, n);
    n = lbs_live_rows(at, with, fr->pose_index, fr->pose_value, fr->npose,
                      h->pose_live ? h->pose_live + b : NULL);
    lbs_add_rows(p, h->pose_dirs + b * HEAD_POSE_DIRS * ROW, at, with, n);
}

/* M (12) = sum_j w_j A_j for vector s of the block. */
static inline void lbs_skin_blend(vf M[12], const struct lbs_frame *fr,
                                  const vf *skin, int s)
{
    vf w = skin[s];

    for (int k = 0; k < 12; k++)
        M[k] = w * fr->A[0][k];
    for (int j = 1; j < HEAD_JOINTS; j++) {
        w = skin[HV * j + s];
        for (int k = 0; k < 12; k++)
            M[k] += w * fr->A[j][k];
    }
}

/* q = M p with the blended transform of each vertex of block b. */
static inline void lbs_skin_block(vf q[NV], const vf p[NV],
                                  const struct lbs_frame *fr, size_t b)
{
    const struct head *h = fr->id->head;
    const vf *skin = (const vf *)(h->skin + b * HEAD_JOINTS * B);

    for (int s = 0; s < HV; s++) {
        vf M[12];

        lbs_skin_blend(M, fr, skin, s);
        for (int i = 0; i < 3; i++)
            q[HV * i + s] = M[4 * i] * p[s] + M[4 * i + 1] * p[HV + s] +
                            M[4 * i + 2] * p[2 * HV + s] + M[4 * i + 3];
    }
}

/* out (n,3) from a block's rows. */
static inline void lbs_write_block(float *out, const vf q[NV], size_t n)
{
    const float *x = (const float *)q, *y = x + B, *z = y + B;

    for (size_t i = 0; i < n; i++) {
        out[3 * i] = x[i];
        out[3 * i + 1] = y[i];
        out[3 * i + 2] = z[i];
    }
}

static size_t lbs_block_length(const struct head *h, size_t b)
{
    size_t left = h->V - b * B;

    return left < B ? left : B;
}

static void lbs_pose(float *verts, const struct lbs_frame *fr)
{
    static const int both[2] = {0, 1};
    const struct head *h = fr->id->head;

    for (size_t b = 0; b < h->blocks; b++) {
        vf p[NV], q[NV];

        lbs_rest_block(p, fr, b);
        lbs_skin_block(q, p, fr, b);
        if (fr->lid[0] != 0 || fr->lid[1] != 0)
            lbs_add_rows(q, fr->id->lids + b * 2 * ROW, both, fr->lid, 2);
        lbs_write_block(verts + b * ROW, q, lbs_block_length(h, b));
    }
}

/* ---- backward ---------------------------------------------------------- */

/* Sum of a vector's lanes, in one order for every width. */
static inline float lbs_sum_lanes(const vf *v)
{
    const float *x = (const float *)v;
    float s[4] = {0};

    for (int i = 0; i < VEC; i++)
        s[i % 4] += x[i];
    return (s[0] + s[1]) + (s[2] + s[3]);
}

/* out[k] += rows[k] . g for the n rows, those alive (NULL: all). */
static inline void lbs_dot_rows(float *out, const float *rows, const vf g[NV],
                                size_t n, const uint64_t *live)
{
    for (size_t k = 0; k < n; k++) {
        const vf *d = (const vf *)(rows + k * ROW);

        if (live && !(live[k / 64] >> k % 64 & 1))
            continue;

        vf s = d[0] * g[0];

#pragma GCC unroll 24
        for (int i = 1; i < NV; i++)
            s += d[i] * g[i];
        out[k] += lbs_sum_lanes(&s);
    }
}

/* Undo q = M p: dp = M^T dq, and dA_j += w_j dq [p;1]^T. */
static inline void lbs_skin_back(vf dp[NV], vf dA[HEAD_JOINTS][12],
                                 const vf dq[NV], const vf p[NV],
                                 const struct lbs_frame *fr, size_t b)
{
    const struct head *h = fr->id->head;
    const vf *skin = (const vf *)(h->skin + b * HEAD_JOINTS * B);

    for (int o = 0; o < HV; o++) {
        vf M[12];

        lbs_skin_blend(M, fr, skin, o);
        for (int c = 0; c < 3; c++)
            dp[HV * c + o] = M[c] * dq[o] + M[4 + c] * dq[HV + o] +
                             M[8 + c] * dq[2 * HV + o];
        for (int j = 0; j < HEAD_JOINTS; j++)
            for (int i = 0; i < 3; i++) {
                vf wd = skin[HV * j + o] * dq[HV * i + o];

                for (int c = 0; c < 3; c++)
                    dA[j][4 * i + c] += wd * p[HV * c + o];
                dA[j][4 * i + 3] += wd;
            }
    }
}

static void lbs_back(struct lbs_sums *s, const float *dverts,
                   const struct lbs_frame *fr)
{
    const struct head *h = fr->id->head;
    vf dA[HEAD_JOINTS][12];

    memset(dA, 0, sizeof dA);
    for (size_t b = 0; b < h->blocks; b++) {
        size_t n = lbs_block_length(h, b);
        vf p[NV], dq[NV], dp[NV];
        float *g = (float *)dq;

        memset(dq, 0, sizeof dq);
        for (size_t i = 0; i < n; i++)
            for (size_t c = 0; c < 3; c++)
                g[c * B + i] = dverts[b * ROW + 3 * i + c];
        lbs_rest_block(p, fr, b);
        /* in the forward pass this was q = M p + lid . Delta */
        lbs_dot_rows(s->lid, fr->id->lids + b * 2 * ROW, dq, 2, NULL);
        lbs_skin_back(dp, dA, dq, p, fr, b);
        /* p = T + shape + expression + pose correctives */
        if (s->exp)
            lbs_dot_rows(s->exp, h->exp_dirs + b * h->nexp * ROW, dp, h->nexp,
                         h->exp_live ? h->exp_live + b * WORDS : NULL);
        if (s->beta)
            lbs_dot_rows(s->beta, h->shape_dirs + b * h->nshape * ROW, dp,
                         h->nshape, NULL);
        lbs_dot_rows(s->pose, h->pose_dirs + b * HEAD_POSE_DIRS * ROW, dp,
                     HEAD_POSE_DIRS, h->pose_live ? h->pose_live + b : NULL);
    }
    for (int j = 0; j < HEAD_JOINTS; j++)
        for (int i = 0; i < 12; i++)
            s->A[j][i] += lbs_sum_lanes(&dA[j][i]);
}

const struct lbs_kernels ISA(lbs_kernels) = {lbs_pose, lbs_back};
