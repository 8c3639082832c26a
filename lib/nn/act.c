/* Activations over whole maps, in chunks of a fixed size over threads, and
 * their derivatives from the input or from the output. */
#include "lib/nn/act.h"

#include "lib/base/parallel.h"
#include "lib/nn/kernels.h"
#include "lib/nn/plan.h"

#define CHUNK 16384

/* One chunk. */
PARALLEL(act_forward_part, part, float *, y, const float *, x, enum nn_act, act,
         size_t, n)
{
    size_t i = part * CHUNK;

    nn_kernels()->act_forward(y + i, x + i, (int)act,
                              n - i < CHUNK ? n - i : CHUNK);
}

void act_forward(float *y, const float *x, enum nn_act act, size_t n)
{
    parallel_each(act_forward_part, (n + CHUNK - 1) / CHUNK, 1, y, x, act, n);
}

/* One chunk. */
PARALLEL(act_backward_part, part, float *, dx, const float *, dy,
         const float *, x, enum nn_act, act, size_t, n)
{
    size_t i = part * CHUNK;

    nn_kernels()->act_backward(dx + i, dy + i, x + i, (int)act,
                               n - i < CHUNK ? n - i : CHUNK);
}

void act_backward(float *dx, const float *dy, const float *x, enum nn_act act,
                  size_t n)
{
    parallel_each(act_backward_part, (n + CHUNK - 1) / CHUNK, 1, dx, dy, x, act,
                  n);
}

/* One chunk. */
PARALLEL(act_backward_out_part, part, float *, dx, const float *, dy,
         const float *, y, enum nn_act, act, size_t, n)
{
    size_t i = part * CHUNK;

    nn_kernels()->act_backward_out(dx + i, dy + i, y + i, (int)act,
                                   n - i < CHUNK ? n - i : CHUNK);
}

void act_backward_out(float *dx, const float *dy, const float *y,
                      enum nn_act act, size_t n)
{
    parallel_each(act_backward_out_part, (n + CHUNK - 1) / CHUNK, 1, dx, dy, y,
                  act, n);
}

/* db (C), unless NULL, += the rows of part (parts,C). */
static void act_add_parts(float *db, const float *part, size_t parts,
                          size_t C)
{
    for (size_t i = 0; db && i < parts; i++)
        for (size_t c = 0; c < C; c++)
            db[c] += part[i * C + c];
}

PARALLEL(act_bias_backward_part, i, float *, part, float *, dout,
         const float *, out, size_t, rows, size_t, parts, size_t, C,
         enum nn_act, act)
{
    size_t r0 = i * rows / parts, r1 = (i + 1) * rows / parts;

    nn_kernels()->act_sums(part + i * C, dout + r0 * C,
                           out ? out + r0 * C : dout, (int)act, r1 - r0, C);
}

void act_bias_backward(float *db, float *dout, float *part, const float *out,
                       enum nn_act act, size_t rows, size_t C)
{
    size_t parts = rows < 8 * NN_SUMS ? 1 : NN_SUMS;

    if (!db && act == ACT_NONE)
        return;

    parallel_each(act_bias_backward_part, parts, 1, part, dout, out, rows,
                  parts, C, act);
    act_add_parts(db, part, parts, C);
}

PARALLEL(act_bias_backward_half_part, i, float *, part, uint16_t *, dout,
         const uint16_t *, out, size_t, rows, size_t, parts, size_t, C,
         enum nn_act, act)
{
    size_t r0 = i * rows / parts, r1 = (i + 1) * rows / parts;

    nn_kernels()->act_sums_half(part + i * C, dout + r0 * C, out + r0 * C,
                                (int)act, r1 - r0, C);
}

void act_bias_backward_half(float *db, uint16_t *dout, float *part,
                            const uint16_t *out, enum nn_act act, size_t rows,
                            size_t C)
{
    size_t parts = rows < 8 * NN_SUMS ? 1 : NN_SUMS;

    if (!db && act == ACT_NONE)
        return;

    parallel_each(act_bias_backward_half_part, parts, 1, part, dout, out, rows,
                  parts, C, act);
    act_add_parts(db, part, parts, C);
}
