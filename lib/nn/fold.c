#include "lib/nn/fold.h"

#include <omp.h>
#include <string.h>

#include "lib/nn/kernels.h"

#define PIECE 32

bool fold_possible(const struct conv *c)
{
    return c->kernel == 2 && c->stride == 2 && c->pad == CONV_NONE &&
           c->act == ACT_LRELU && c->out % 16 == 0 && c->bias != NN_NONE &&
           c->in >= 3;
}

void fold_plan(struct fold *f, const struct conv *c, struct nn_plan *p,
               size_t batch, size_t h, size_t w)
{
    *f = (struct fold){ .c = c, .batch = batch, .h = h, .w = w };
    f->line = 4 * PIECE * c->in;
    f->weight = nn_plan_floats(p, c->out * 4 * c->in);
    f->bias = nn_plan_floats(p, c->out);
    f->wide = nn_plan_floats(p, f->line * (size_t)omp_get_max_threads());
}

void fold_update(struct fold *f)
{
    const struct conv *c = f->c;
    const float *w = param_w(c->ps, c->weight);      /* (out,in,2,2) */
    memcpy(f->bias, param_w(c->ps, c->bias), c->out * sizeof *f->bias);
    for (size_t o = 0; o < c->out; o++)
        for (size_t i = 0; i < c->in; i++)
            for (size_t k = 0; k < 4; k++)
                f->weight[((o / 16 * 4 + k) * c->in + i) * 16 + o % 16] =
                    w[(o * c->in + i) * 4 + k];
}

/* PIECE pixels of the output, or what is left of row r. */
static void piece(float *out, float *rgb, const struct fold_view *in,
                  const struct fold *f, size_t r, size_t x)
{
    const struct nn_kernels *k = nn_kernels();
    size_t C = f->c->in, O = f->c->out, half = f->w / 2;
    size_t n = half - x < PIECE ? half - x : PIECE;
    size_t at = 2 * r * in->stride + 2 * x * C, ahead = at + 2 * PIECE * C;
    float *wide = f->wide + (size_t)omp_get_thread_num() * f->line;
    struct fold_rows rows = { { wide, wide + 2 * n * C }, { 0 }, 0 };
    for (size_t y = 0; y < 2; y++, at += in->stride, ahead += in->stride) {
        if (in->f32) {
            rows.row[y] = in->f32 + at;
            rows.next[y] = (const char *)(in->f32 + ahead);
            rows.step = 16 * sizeof *in->f32;
        } else {                 /* widened into the nearest cache */
            k->widen(wide + y * 2 * n * C, in->f16 + at, 2 * n * C);
            rows.next[y] = (const char *)(in->f16 + ahead);
            rows.step = 16 * sizeof *in->f16;
        }
    }
    k->fold_row(out + (r * half + x) * O, &rows, f->weight, f->bias, n, C, O);
    for (size_t y = 0; y < 2; y++)
        k->pick_rgb(rgb + ((2 * r + y) * f->w + 2 * x) * 3, rows.row[y],
                    2 * n, C);
}

void fold_forward(float *out, float *rgb, const struct fold_view *in,
                  const struct fold *f)
{
#pragma omp parallel for schedule(static)
    for (size_t r = 0; r < f->batch * (f->h / 2); r++)
        for (size_t x = 0; x < f->w / 2; x += PIECE)
            piece(out, rgb, in, f, r, x);
}
