/* Softmax attention over the tokens of each item, heads apart. */
#ifndef SPID_NN_ATTENTION_H
#define SPID_NN_ATTENTION_H

#include "lib/nn/plan.h"

struct attention {
    size_t batch, tokens, heads, dim;    /* dim of one head */
    size_t row, part;                    /* floats from a row of qkv to the next,
                                          * from queries to keys to values */
    struct nn_plan *plan;
    size_t work;                         /* floats of scratch per thread */
};

/* For items of `tokens` rows, `heads` heads of `dim` numbers. */
void attention_plan(struct attention *a, struct nn_plan *p, size_t batch,
                    size_t tokens, size_t heads, size_t dim);
/* out (B,T,heads*dim) = softmax(q k^T / sqrt(dim)) v, qkv (B,T,3,heads,dim); a
 * forward of one item may have them in three blocks: row = heads * dim, part =
 * T * row, set after planning. */
void attention_forward(float *out, const float *qkv, struct attention *a);
/* dqkv is written; the probabilities are computed again. */
void attention_backward(float *dqkv, const float *dout, const float *qkv,
                        struct attention *a);

#endif
