/* Posing in one pass over memory, compiled per instruction set.  A block is
 * 32 vertices as x[32] y[32] z[32] = six vectors of 16; its directions lie
 * one after the other, so the six sums stay in registers while memory is read
 * front to back. */
#include "lib/head/lbs_kernel.h"

#include <string.h>

#define B HEAD_BLOCK
#define ROW (3 * B)

/* The compiler splits a vector where the registers are narrower. */
typedef float vec __attribute__((vector_size(64), aligned(64), may_alias));
#define NV (ROW / 16)   /* vectors of a row: x x y y z z */

/* a += value[i] * rows[index[i]] */
static inline void add_rows(vec a[NV], const float *rows, const int *index,
                            const float *value, size_t n)
{
    vec s0 = a[0], s1 = a[1], s2 = a[2], s3 = a[3], s4 = a[4], s5 = a[5];

    for (size_t i = 0; i < n; i++) {
        const vec *d = (const vec *)(rows + (size_t)index[i] * ROW);
        float c = value[i];

        s0 += c * d[0];
        s1 += c * d[1];
        s2 += c * d[2];
        s3 += c * d[3];
        s4 += c * d[4];
        s5 += c * d[5];
    }
    a[0] = s0;
    a[1] = s1;
    a[2] = s2;
    a[3] = s3;
    a[4] = s4;
    a[5] = s5;
}

/* p = T + B_S + B_E + B_P of block b. */
static inline void rest_block(vec p[NV], const struct lbs_frame *fr, size_t b)
{
    const struct head *h = fr->id->head;
    const vec *shaped = (const vec *)(fr->id->shaped + b * ROW);

    for (int i = 0; i < NV; i++)
        p[i] = shaped[i];
    add_rows(p, h->exp_dirs + b * h->nexp * ROW, fr->exp_index,
             fr->exp_value, fr->nexp);
    add_rows(p, h->pose_dirs + b * HEAD_POSE_DIRS * ROW, fr->pose_index,
             fr->pose_value, fr->npose);
}

/* M (12) = sum_j w_j A_j for half s (16 vertices) of the block. */
static inline void blend(vec M[12], const struct lbs_frame *fr,
                         const vec *skin, int s)
{
    vec w = skin[s];

    for (int k = 0; k < 12; k++)
        M[k] = w * fr->A[0][k];
    for (int j = 1; j < HEAD_JOINTS; j++) {
        w = skin[2 * j + s];
        for (int k = 0; k < 12; k++)
            M[k] += w * fr->A[j][k];
    }
}

static inline void skin_block(vec q[NV], const vec p[NV],
                              const struct lbs_frame *fr, size_t b)
{
    const struct head *h = fr->id->head;
    const vec *skin = (const vec *)(h->skin + b * HEAD_JOINTS * B);

    for (int s = 0; s < 2; s++) {
        vec M[12];

        blend(M, fr, skin, s);
        for (int i = 0; i < 3; i++)
            q[2 * i + s] = M[4 * i] * p[s] + M[4 * i + 1] * p[2 + s] +
                           M[4 * i + 2] * p[4 + s] + M[4 * i + 3];
    }
}

/* out (n,3) from a block's rows. */
static inline void write_block(float *out, const vec q[NV], size_t n)
{
    const float *x = (const float *)q, *y = x + B, *z = y + B;

    for (size_t i = 0; i < n; i++) {
        out[3 * i] = x[i];
        out[3 * i + 1] = y[i];
        out[3 * i + 2] = z[i];
    }
}

static size_t block_length(const struct head *h, size_t b)
{
    size_t left = h->V - b * B;

    return left < B ? left : B;
}

void ISA(lbs_pose)(float *verts, const struct lbs_frame *fr)
{
    static const int both[2] = {0, 1};
    const struct head *h = fr->id->head;

    for (size_t b = 0; b < h->blocks; b++) {
        vec p[NV], q[NV];

        rest_block(p, fr, b);
        skin_block(q, p, fr, b);
        if (fr->lid[0] != 0 || fr->lid[1] != 0)
            add_rows(q, h->lids + b * 2 * ROW, both, fr->lid, 2);
        write_block(verts + b * ROW, q, block_length(h, b));
    }
}

/* ---- backward ---------------------------------------------------------- */

static inline float sum16(const vec *v)
{
    const float *x = (const float *)v;
    float s[4];

    for (int i = 0; i < 4; i++)
        s[i] = (x[i] + x[i + 4]) + (x[i + 8] + x[i + 12]);
    return (s[0] + s[1]) + (s[2] + s[3]);
}

/* out[k] += rows[k] . g for n rows */
static inline void dot_rows(float *out, const float *rows, const vec g[NV],
                            size_t n)
{
    for (size_t k = 0; k < n; k++) {
        const vec *d = (const vec *)(rows + k * ROW);

        vec s = d[0] * g[0] + d[1] * g[1] + d[2] * g[2] + d[3] * g[3] +
                d[4] * g[4] + d[5] * g[5];

        out[k] += sum16(&s);
    }
}

/* Undo q = M p: dp = M^T dq, and dA_j += w_j dq [p;1]^T. */
static inline void skin_back(vec dp[NV], struct lbs_sums *s, const vec dq[NV],
                             const vec p[NV], const struct lbs_frame *fr,
                             size_t b)
{
    const struct head *h = fr->id->head;
    const vec *skin = (const vec *)(h->skin + b * HEAD_JOINTS * B);

    for (int half = 0; half < 2; half++) {
        vec M[12];

        blend(M, fr, skin, half);
        for (int c = 0; c < 3; c++)
            dp[2 * c + half] = M[c] * dq[half] + M[4 + c] * dq[2 + half] +
                               M[8 + c] * dq[4 + half];
        for (int j = 0; j < HEAD_JOINTS; j++)
            for (int i = 0; i < 3; i++) {
                vec wd = skin[2 * j + half] * dq[2 * i + half];

                for (int c = 0; c < 3; c++) {
                    vec t = wd * p[2 * c + half];

                    s->A[j][4 * i + c] += sum16(&t);
                }
                s->A[j][4 * i + 3] += sum16(&wd);
            }
    }
}

void ISA(lbs_back)(struct lbs_sums *s, const float *dverts,
                   const struct lbs_frame *fr)
{
    const struct head *h = fr->id->head;

    for (size_t b = 0; b < h->blocks; b++) {
        size_t n = block_length(h, b);
        vec p[NV], dq[NV], dp[NV];
        float *g = (float *)dq;

        memset(dq, 0, sizeof dq);
        for (size_t i = 0; i < n; i++)
            for (size_t c = 0; c < 3; c++)
                g[c * B + i] = dverts[b * ROW + 3 * i + c];
        rest_block(p, fr, b);
        /* in the forward pass this was q = M p + lid . Delta */
        dot_rows(s->lid, h->lids + b * 2 * ROW, dq, 2);
        skin_back(dp, s, dq, p, fr, b);
        /* p = T + shape + expression + pose correctives */
        if (s->exp)
            dot_rows(s->exp, h->exp_dirs + b * h->nexp * ROW, dp, h->nexp);
        if (s->beta)
            dot_rows(s->beta, h->shape_dirs + b * h->nshape * ROW, dp,
                     h->nshape);
        dot_rows(s->pose, h->pose_dirs + b * HEAD_POSE_DIRS * ROW, dp,
                 HEAD_POSE_DIRS);
    }
}
