#include "lib/nn/patch.h"

#include <string.h>

#include "lib/nn/conv.h"
#include "lib/nn/kernels.h"

#define PIECE 128        /* terms of one chain */
#define COLUMNS 64       /* of a piece of work: two panels of gemm's */
#define ROWS 48

bool patch_wanted(const struct conv *c)
{
    enum nn_type type = c->plan->opt.type;
    size_t most = type == NN_F32 ? 1024 : type == NN_FAST ? 256 : 0;
    return c->kernel == 3 && c->stride == 1 && c->pad == CONV_HALF &&
           c->h * c->w <= most &&
           c->in_data >= 256 && c->in_data % PIECE == 0 &&
           c->act <= ACT_LRELU;
}

void patch_plan(struct patch *t, const struct conv *c, struct nn_plan *p)
{
    size_t rows = c->batch * c->h * c->w;
    t->c = c;
    t->K = 9 * c->in_data;
    t->N = (c->out + COLUMNS - 1) / COLUMNS * COLUMNS;
    t->w = nn_plan_floats(p, t->K * t->N);
    t->bias = nn_plan_floats(p, c->out);
    t->rows = nn_plan_floats(p, rows * t->K);
    t->sum = nn_plan_floats(p, rows * t->N);
}

/* w (out,in,3,3): term (tap,i) of the sum is row tap * in + i of a matrix. */
void patch_update(struct patch *t, const float *w, const float *bias)
{
    const struct nn_kernels *k = nn_kernels();
    size_t in = t->c->in_data, out = t->c->out, each = in / PIECE;
    memcpy(t->bias, bias, out * sizeof *bias);
#pragma omp parallel for schedule(static)
    for (size_t j = 0; j < t->K / PIECE; j++)
        k->gemm_pack(t->w + j * PIECE * t->N,
                     w + (j % each) * PIECE * 9 + j / each, 9, 9 * in, PIECE,
                     out);
}

/* rows (B*h*w, 9 in): the 3x3 neighbours of every pixel, zeros outside. */
static void unfold(const float *in, struct patch *t)
{
    const struct conv *c = t->c;
    size_t C = c->in_data, h = c->h, w = c->w;
#pragma omp parallel for schedule(static)
    for (size_t r = 0; r < c->batch * h * w; r++) {
        size_t n = r / (h * w), y = r / w % h, x = r % w;
        float *to = t->rows + r * t->K;
        for (size_t k = 0; k < 9; k++, to += C) {
            size_t yy = y + k / 3, xx = x + k % 3;   /* one too many */
            if (yy < 1 || yy > h || xx < 1 || xx > w)
                memset(to, 0, C * sizeof *to);
            else
                memcpy(to, in + ((n * h + yy - 1) * w + xx - 1) * C,
                       C * sizeof *to);
        }
    }
}

void patch_forward(float *out, const float *in, struct patch *t)
{
    const struct nn_kernels *k = nn_kernels();
    const struct conv *c = t->c;
    size_t M = c->batch * c->h * c->w, N = c->out;
    unfold(in, t);
#pragma omp parallel for collapse(2) schedule(static)
    for (size_t m0 = 0; m0 < M; m0 += ROWS)
        for (size_t n0 = 0; n0 < t->N; n0 += COLUMNS) {
            size_t n = N - n0 < COLUMNS ? N - n0 : COLUMNS;
            size_t m = M - m0 < ROWS ? M - m0 : ROWS;
            for (size_t j = 0; j < t->K / PIECE; j++)
                k->gemm(t->sum + m0 * t->N + n0, t->N,
                        t->rows + m0 * t->K + j * PIECE, t->K, 1,
                        t->w + j * PIECE * t->N + n0 * PIECE, m, n, PIECE,
                        j > 0);
        }
    for (size_t r = 0; r < M; r++) {
        float *to = out + r * N;
        const float *from = t->sum + r * t->N;
        for (size_t o = 0; o < N; o++)
            to[o] = (c->add ? to[o] : 0.0f) + (from[o] + t->bias[o]);
    }
    if (c->act != ACT_NONE)
        act_forward(out, out, c->act, M * N);
}
