/* Softmax attention (Vaswani et al. 2017), a block of queries against all keys
 * at a time, so that the probabilities stay in the cache; the backward makes
 * them again. */
#include "lib/nn/attention.h"

#include <math.h>
#include <string.h>

#include "lib/base/parallel.h"
#include "lib/nn/kernels.h"

#define ROWS 48        /* queries at once */

/* One thread's scratch: packed matrices and two blocks of probabilities. */
struct attention_work {
    float *kt, *v, *k, *vt, *block, *p, *dp;
    size_t ld;
};

/* n rounded up to a multiple of 32. */
static size_t attention_round_up(size_t n)
{
    return (n + 31) / 32 * 32;
}

void attention_plan(struct attention *a, struct nn_plan *p, size_t batch,
                    size_t tokens, size_t heads, size_t dim)
{
    *a = (struct attention){ .batch = batch, .tokens = tokens,
                             .heads = heads, .dim = dim, .plan = p };
    size_t T = attention_round_up(tokens), d = attention_round_up(dim);

    a->part = heads * dim;
    a->row = 3 * a->part;
    a->work = 2 * T * d + ROWS * T;
    if (nn_plan_backward(p))
        a->work += 2 * T * d + ROWS * T + ROWS * d;
    nn_plan_scratch(p, a->work * sizeof(float) *
                           (size_t)parallel_width());
}

/* Where the calling thread's share of the plan's scratch lies. */
static struct attention_work attention_work(const struct attention *a)
{
    size_t T = attention_round_up(a->tokens);
    size_t d = attention_round_up(a->dim);
    float *at = (float *)(void *)a->plan->scratch +
                parallel_slot() * a->work;
    struct attention_work w = { .ld = T };

    w.kt = at;
    w.v = w.kt + T * d;
    w.p = w.v + T * d;
    w.k = w.p + ROWS * T;
    w.vt = w.k + T * d;
    w.dp = w.vt + T * d;
    w.block = w.dp + ROWS * T;
    return w;
}

/* One head of one item: a block of queries at a time, p = softmax(q k^T
 * scale), out = p v. */
static void attention_head_forward(float *out, const float *q,
                                   const struct attention *a)
{
    const struct nn_kernels *k = nn_kernels();
    struct attention_work w = attention_work(a);
    size_t T = a->tokens, d = a->dim, E = a->heads * d;

    k->gemm_pack(w.kt, q + a->part, 1, a->row, d, T);
    k->gemm_pack(w.v, q + 2 * a->part, a->row, 1, T, d);
    for (size_t m = 0; m < T; m += ROWS) {
        size_t n = T - m < ROWS ? T - m : ROWS;

        k->gemm(w.p, w.ld, q + m * a->row, a->row, 1, w.kt, n, T, d, NULL, 0);
        k->softmax(w.p, n, T, w.ld, 1 / sqrtf((float)d));
        k->gemm(out + m * E, E, w.p, w.ld, 1, w.v, n, d, T, NULL, 0);
    }
}

PARALLEL(attention_forward_part, k, float *, out, const float *, qkv,
         struct attention *, a, size_t, T, size_t, E, size_t, d)
{
    size_t b = k / a->heads, h = k % a->heads;

    attention_head_forward(out + b * T * E + h * d, qkv + b * T * 3 * E + h * d,
                           a);
}

void attention_forward(float *out, const float *qkv, struct attention *a)
{
    size_t T = a->tokens, d = a->dim, E = a->heads * d;

    parallel_each(attention_forward_part, a->batch * a->heads, 1, out, qkv, a,
                  T, E, d);
}

/* In the forward pass, for a block of queries: p = softmax(q k^T scale),
 * out = p v. */
static void attention_head_backward(float *dq, const float *dout,
                                    const float *q, const struct attention *a)
{
    const struct nn_kernels *k = nn_kernels();
    struct attention_work w = attention_work(a);
    size_t T = a->tokens, d = a->dim, E = a->heads * d;
    float scale = 1 / sqrtf((float)d);

    k->gemm_pack(w.kt, q + E, 1, 3 * E, d, T);
    k->gemm_pack(w.vt, q + 2 * E, 1, 3 * E, d, T);
    k->gemm_pack(w.k, q + E, 3 * E, 1, T, d);
    for (size_t m = 0; m < T; m += ROWS) {
        size_t n = T - m < ROWS ? T - m : ROWS;

        k->gemm(w.p, w.ld, q + m * 3 * E, 3 * E, 1, w.kt, n, T, d, NULL, 0);
        k->softmax(w.p, n, T, w.ld, scale);
        k->gemm(w.dp, w.ld, dout + m * E, E, 1, w.vt, n, T, d, NULL, 0);
        k->gemm_pack(w.block, dout + m * E, E, 1, n, d);
        k->gemm(dq + 2 * E, 3 * E, w.p, 1, w.ld, w.block, T, d, n,
                m > 0 ? dq + 2 * E : NULL, 3 * E);
        k->softmax_backward(w.dp, w.p, n, T, w.ld, scale);
        k->gemm(dq + m * 3 * E, 3 * E, w.dp, w.ld, 1, w.k, n, d, T, NULL, 0);
        k->gemm_pack(w.block, q + m * 3 * E, 3 * E, 1, n, d);
        k->gemm(dq + E, 3 * E, w.dp, 1, w.ld, w.block, T, d, n,
                m > 0 ? dq + E : NULL, 3 * E);
    }
}

PARALLEL(attention_backward_part, k, float *, dqkv, const float *, dout,
         const float *, qkv, struct attention *, a, size_t, T, size_t, E,
         size_t, d)
{
    size_t b = k / a->heads, h = k % a->heads;

    attention_head_backward(dqkv + b * T * 3 * E + h * d,
                            dout + b * T * E + h * d,
                            qkv + b * T * 3 * E + h * d, a);
}

void attention_backward(float *dqkv, const float *dout, const float *qkv,
                        struct attention *a)
{
    size_t T = a->tokens, d = a->dim, E = a->heads * d;

    parallel_each(attention_backward_part, a->batch * a->heads, 1, dqkv, dout,
                  qkv, a, T, E, d);
}
