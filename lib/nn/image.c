/* Elementwise work on feature images, split over threads in chunks of a fixed
 * size. */
#include "lib/nn/image.h"

#include <string.h>

#include "lib/base/parallel.h"
#include "lib/nn/act.h"
#include "lib/nn/kernels.h"

#define CHUNK 16384

struct image_add_part {
    const struct nn_kernels *k;
    float *y;
    const float *x;
    size_t n;
};

/* One chunk. */
static void image_add_part(void *ctx, size_t part)
{
    const struct image_add_part *c = ctx;
    size_t i = part * CHUNK;

    c->k->add(c->y + i, c->x + i, c->n - i < CHUNK ? c->n - i : CHUNK);
}

void image_add(float *y, const float *x, size_t n)
{
    const struct nn_kernels *k = nn_kernels();

    parallel_for((n + CHUNK - 1) / CHUNK, 1, image_add_part,
                 &(struct image_add_part){ k, y, x, n });
}

struct image_to_bf16_part {
    const struct nn_kernels *k;
    uint16_t *y;
    const float *x;
    size_t n;
};

/* One chunk. */
static void image_to_bf16_part(void *ctx, size_t part)
{
    const struct image_to_bf16_part *c = ctx;
    size_t i = part * CHUNK;

    c->k->to_bf16(c->y + i, c->x + i, c->n - i < CHUNK ? c->n - i : CHUNK);
}

void image_to_bf16(uint16_t *y, const float *x, size_t n)
{
    const struct nn_kernels *k = nn_kernels();

    parallel_for((n + CHUNK - 1) / CHUNK, 1, image_to_bf16_part,
                 &(struct image_to_bf16_part){ k, y, x, n });
}

struct sft_forward_part {
    const struct nn_kernels *k;
    float *y;
    const float *x, *st;
    size_t C, rows, step;
    float one;
};

/* One chunk. */
static void sft_forward_part(void *ctx, size_t part)
{
    const struct sft_forward_part *c = ctx;
    size_t r = part * c->step;

    c->k->sft_forward(c->y + r * c->C, c->x + r * c->C, c->st + 2 * r * c->C,
                      c->one, c->rows - r < c->step ? c->rows - r : c->step,
                      c->C);
}

void sft_forward(float *y, const float *x, const float *st, float one,
                 size_t rows, size_t C)
{
    const struct nn_kernels *k = nn_kernels();
    size_t step = CHUNK / C + 1;

    parallel_for((rows + step - 1) / step, 1, sft_forward_part,
                 &(struct sft_forward_part){ k, y, x, st, C, rows, step, one });
}

struct sft_backward_part {
    const struct nn_kernels *k;
    float *dx, *dst;
    const float *dy, *x, *st;
    size_t C, rows, step;
    float one;
};

/* One chunk. */
static void sft_backward_part(void *ctx, size_t part)
{
    const struct sft_backward_part *c = ctx;
    size_t r = part * c->step;

    c->k->sft_backward(c->dx + r * c->C, c->dst + 2 * r * c->C,
                       c->dy + r * c->C, c->x + r * c->C, c->st + 2 * r * c->C,
                       c->one, c->rows - r < c->step ? c->rows - r : c->step,
                       c->C);
}

void sft_backward(float *dx, float *dst, const float *dy, const float *x,
                  const float *st, float one, size_t rows, size_t C)
{
    const struct nn_kernels *k = nn_kernels();
    size_t step = CHUNK / C + 1;

    parallel_for((rows + step - 1) / step, 1, sft_backward_part,
                 &(struct sft_backward_part){ k, dx, dst, dy, x, st, C, rows,
                                              step, one });
}

struct concat_forward_part {
    float *out;
    const float *a, *b;
    size_t C, A, group, Bc;
};

/* One row. */
static void concat_forward_part(void *ctx, size_t r)
{
    const struct concat_forward_part *c = ctx;
    float *to = c->out + r * c->C;

    if (c->a)
        memcpy(to, c->a + r * c->A, c->A * sizeof *to);
    memcpy(to + c->A, c->b + r / c->group * c->Bc, c->Bc * sizeof *to);
    memset(to + c->A + c->Bc, 0, (c->C - c->A - c->Bc) * sizeof *to);
}

void concat_forward(float *out, const float *a, const float *b, size_t rows,
                    size_t A, size_t Bc, size_t C, size_t group)
{
    parallel_for(rows, 1, concat_forward_part,
                 &(struct concat_forward_part){ out, a, b, C, A, group, Bc });
}

struct concat_backward_part { float *da; const float *dout; size_t A, C; };

/* One row. */
static void concat_backward_part(void *ctx, size_t r)
{
    const struct concat_backward_part *c = ctx;

    memcpy(c->da + r * c->A, c->dout + r * c->C, c->A * sizeof *c->da);
}

struct concat_backward_channel {
    const float *dout;
    float *db;
    size_t rows, group, C, A, Bc;
};

static void concat_backward_channel(void *ctx, size_t c)
{
    const struct concat_backward_channel *a = ctx;

    for (size_t g = 0; g < a->rows / a->group; g++) {
        double sum = 0;

        for (size_t r = g * a->group; r < (g + 1) * a->group; r++)
            sum += (double)a->dout[r * a->C + a->A + c];
        a->db[g * a->Bc + c] += (float)sum;
    }
}

void concat_backward(float *da, float *db, const float *dout, size_t rows,
                     size_t A, size_t Bc, size_t C, size_t group)
{
    if (da) {

        parallel_for(rows, 1, concat_backward_part,
                     &(struct concat_backward_part){ da, dout, A, C });
    }
    if (!db)
        return;

    parallel_for(
        Bc, 1, concat_backward_channel,
        &(struct concat_backward_channel){ dout, db, rows, group, C, A, Bc });
}

void concat_rows(float *out, const float *a, const float *b, size_t rows,
                 size_t A, size_t Bc, size_t C)
{
    concat_forward(out, a, b, rows, A, Bc, C, 1);
}

struct concat_rows_backward_part {
    float *db;
    const float *dout;
    size_t Bc, C, A;
};

/* One row. */
static void concat_rows_backward_part(void *ctx, size_t r)
{
    const struct concat_rows_backward_part *c = ctx;

    memcpy(c->db + r * c->Bc, c->dout + r * c->C + c->A, c->Bc * sizeof *c->db);
}

void concat_rows_backward(float *db, const float *dout, size_t rows, size_t A,
                          size_t Bc, size_t C)
{
    parallel_for(rows, 1, concat_rows_backward_part,
                 &(struct concat_rows_backward_part){ db, dout, Bc, C, A });
}

void relu_copy(float *y, const float *x, size_t n)
{
    act_forward(y, x, ACT_RELU, n);
}

struct relu_add_backward_part { const float *y, *dy; float *dx; };

static void relu_add_backward_part(void *ctx, size_t i)
{
    const struct relu_add_backward_part *c = ctx;

    if (c->y[i] > 0.0f)
        c->dx[i] += c->dy[i];
}

void relu_add_backward(float *dx, const float *dy, const float *y, size_t n)
{
    parallel_for(n, 1, relu_add_backward_part,
                 &(struct relu_add_backward_part){ y, dy, dx });
}

struct space_to_depth_part {
    float *out;
    const float *in, *mean;
    size_t ow, oh, row, f, h, w, C;
    float scale;
};

static void space_to_depth_part(void *ctx, size_t k)
{
    const struct space_to_depth_part *c = ctx;
    size_t n = k / c->oh, y = k % c->oh;

    for (size_t x = 0; x < c->ow; x++) {
        float *to = c->out + ((n * c->oh + y) * c->ow + x) * c->row;

        for (size_t dy = 0; dy < c->f; dy++) {
            const float *p =
                c->in + ((n * c->h + y * c->f + dy) * c->w + x * c->f) * c->C;

            for (size_t i = 0; i < c->f * c->C; i++)
                to[dy * c->f * c->C + i] =
                    (p[i] - (c->mean ? c->mean[i % c->C] : 0.0f)) * c->scale;
        }
    }
}

void space_to_depth(float *out, const float *in, const float *mean,
                    float scale, size_t B, size_t h, size_t w, size_t C,
                    size_t f)
{
    size_t oh = h / f, ow = w / f, row = f * f * C;

    parallel_for(B * oh, 1, space_to_depth_part,
                 &(struct space_to_depth_part){ out, in, mean, ow, oh, row, f,
                                                h, w, C, scale });
}

struct depth_to_space_part { const float *in; float *out; size_t h, f, w, C; };

static void depth_to_space_part(void *ctx, size_t k)
{
    const struct depth_to_space_part *c = ctx;
    size_t n = k / (c->h * c->f), y = k % (c->h * c->f);
    const float *p =
        c->in + ((n * c->h + y / c->f) * c->w * c->f + y % c->f) * c->f * c->C;
    float *to = c->out + (n * c->h * c->f + y) * c->w * c->f * c->C;

    for (size_t x = 0; x < c->w;
         x++, p += c->f * c->f * c->C, to += c->f * c->C)
        memcpy(to, p, c->f * c->C * sizeof *to);
}

void depth_to_space(float *out, const float *in, size_t B, size_t h, size_t w,
                    size_t C, size_t f)
{
    parallel_for(B * (h * f), 1, depth_to_space_part,
                 &(struct depth_to_space_part){ in, out, h, f, w, C });
}

struct depth_to_space_add_part {
    const float *in, *base;
    float *out;
    size_t h, f, w, C, base_C;
};

static void depth_to_space_add_part(void *ctx, size_t k)
{
    const struct depth_to_space_add_part *a = ctx;
    size_t n = k / (a->h * a->f), y = k % (a->h * a->f);
    const float *p =
        a->in + ((n * a->h + y / a->f) * a->w * a->f + y % a->f) * a->f * a->C;
    const float *b = a->base + (n * a->h * a->f + y) * a->w * a->f * a->base_C;
    float *to = a->out + (n * a->h * a->f + y) * a->w * a->f * a->C;

    for (size_t x = 0; x < a->w; x++, p += a->f * a->f * a->C)
        for (size_t i = 0; i < a->f; i++, b += a->base_C, to += a->C)
            for (size_t c = 0; c < a->C; c++)
                to[c] = b[c] + p[i * a->C + c];
}

void depth_to_space_add(float *out, const float *base, size_t base_C,
                        const float *in, size_t B, size_t h, size_t w,
                        size_t C, size_t f)
{
    parallel_for(
        B * (h * f), 1, depth_to_space_add_part,
        &(struct depth_to_space_add_part){ in, base, out, h, f, w, C, base_C });
}

struct depth_to_space_backward_part {
    float *din;
    const float *dout;
    size_t h, f, w, C;
};

static void depth_to_space_backward_part(void *ctx, size_t k)
{
    const struct depth_to_space_backward_part *c = ctx;
    size_t n = k / (c->h * c->f), y = k % (c->h * c->f);
    float *p =
        c->din + ((n * c->h + y / c->f) * c->w * c->f + y % c->f) * c->f * c->C;
    const float *g = c->dout + (n * c->h * c->f + y) * c->w * c->f * c->C;

    for (size_t x = 0; x < c->w; x++, p += c->f * c->f * c->C, g += c->f * c->C)
        memcpy(p, g, c->f * c->C * sizeof *p);
}

void depth_to_space_backward(float *din, const float *dout, size_t B,
                             size_t h, size_t w, size_t C, size_t f)
{
    parallel_for(
        B * (h * f), 1, depth_to_space_backward_part,
        &(struct depth_to_space_backward_part){ din, dout, h, f, w, C });
}
